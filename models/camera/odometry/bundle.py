"""Bundle adjustment of one shot: Levenberg-Marquardt with the points eliminated (Schur complement), robust weights.

Section 3.2 of the paper uses LEAP-VO's windowed bundle adjustment; this is the same idea with all three coordinates
of a point free. A point is X = anchor + direction / ρ with a unit direction and inverse depth ρ; in homogeneous form,
camera i sees

    q = R_shot_camᵀ (direction + ρ (anchor − t_shot_cam)),     x = f q_xy / q_z

which stays smooth at ρ = 0: points at infinity, and with ρ and t held at zero, a camera that only rotates.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import bsr_matrix, csr_matrix

from humanmm.models.geometry import rotations
from humanmm.models.geometry.robust import cauchy_loss, cauchy_weight, std_of_lengths

MIN_GAIN = 1e-4
"""Relative decrease of the cost below which an adjustment ends."""
MIN_DEPTH = 1e-3
"""q_z of a unit direction below which a point counts as behind the camera."""


@dataclass(eq=False)
class Views:
    """Camera poses of K images in the shot frame, with one focal length.

    The odometry places one image after the other and changes the arrays in place; an adjustment makes new ones.
    """

    R_shot_cam: Float[np.ndarray, "k 3 3"]
    t_shot_cam: Float[np.ndarray, "k 3"]
    """Camera centres, in the unit of the shot's path (metres are not known yet)."""
    log_zoom: Float[np.ndarray, " k"]
    """Logarithm of each image's focal length over `focal_px`."""
    focal_px: float

    @property
    def focals_px(self) -> Float[np.ndarray, " k"]:
        """Each image's focal length."""
        return np.asarray(self.focal_px * np.exp(self.log_zoom))


@dataclass(eq=False)
class Points:
    """P points of the background in inverse-depth form, shot frame: X = anchor + direction / ρ.

    The odometry changes the arrays in place as it places points; an adjustment makes new ones.
    """

    direction: Float[np.ndarray, "p 3"]
    """Unit vectors from the anchors."""
    rho: Float[np.ndarray, " p"]
    """ρ, one over the distance from the anchor, in one over that unit; 0 of points at infinity."""
    anchor: Float[np.ndarray, "p 3"]
    """Centre of the camera that saw the point first."""

    def select(self, keep: np.ndarray) -> "Points":
        """Some of them, by number or mask; copied."""
        return Points(self.direction[keep], self.rho[keep], self.anchor[keep])

    def positions(self) -> Float[np.ndarray, "p 3"]:
        """Points in the shot frame; meaningful where rho is clearly positive."""
        return np.asarray(self.anchor + self.direction / self.rho[:, None])


@dataclass(frozen=True)
class Observations:
    """M sightings of points in images."""

    image: Int[np.ndarray, " m"]
    """Number of the image among the `Views` that these sightings are held against: recorded images, keyframes or those
    of a window. `TrackedShot.of_images` has them in order."""
    point: Int[np.ndarray, " m"]
    """Number of the point among the `Points`."""
    xy: Float[np.ndarray, "m 2"]
    """Pixels relative to the principal point."""

    def select(self, keep: np.ndarray) -> "Observations":
        """Some of them, by number or mask."""
        return Observations(self.image[keep], self.point[keep], self.xy[keep])


@dataclass(frozen=True)
class Freedom:
    """What an adjustment may change beside rotations and point directions."""

    translation: bool
    """Camera centres and inverse depths."""
    zoom: bool = False
    """One focal length per image."""


@dataclass(frozen=True)
class Adjusted:
    """Outcome of an adjustment."""

    views: Views
    points: Points
    residual_px: Float[np.ndarray, " m"]
    """Reprojection error per observation; inf behind the camera."""
    cost: float
    """Sum of the robust loss, in units of the noise."""
    noise_px: float
    """Robust standard deviation of the residuals, one axis, no less than the floor given to `adjust`: the scale of the
    robust loss."""


def project(
    views: Views, points: Points, observations: Observations
) -> tuple[Float[np.ndarray, "m 3"], Float[np.ndarray, "m 2"]]:
    """Homogeneous camera coordinates q and pixels (relative to the principal point) of every observation."""
    i, p = observations.image, observations.point
    offset = points.anchor[p] - views.t_shot_cam[i]
    ray = points.direction[p] + points.rho[p, None] * offset
    q = np.einsum("mji,mj->mi", views.R_shot_cam[i], ray)
    z = np.where(q[:, 2] > MIN_DEPTH, q[:, 2], np.inf)
    return q, views.focals_px[i, None] * q[:, :2] / z[:, None]


def residuals(views: Views, points: Points, observations: Observations) -> Float[np.ndarray, " m"]:
    """Reprojection error of every observation, pixels; inf behind the camera."""
    q, xy = project(views, points, observations)
    return np.where(q[:, 2] > MIN_DEPTH, np.linalg.norm(xy - observations.xy, axis=1), np.inf)


def noise_of(residual_px: Float[np.ndarray, " m"], floor_px: float) -> float:
    """Robust standard deviation (one axis) of two-dimensional residuals, at least `floor_px`."""
    finite = residual_px[np.isfinite(residual_px)]
    return max(std_of_lengths(finite), floor_px) if len(finite) else floor_px


def robust_loss(residual_px: Float[np.ndarray, " m"], noise_px: float) -> Float[np.ndarray, " m"]:
    """Cauchy loss with its scale at two standard deviations; a constant for points behind the camera."""
    scaled = np.minimum(residual_px, 1e4) / (2.0 * noise_px)
    return 4.0 * cauchy_loss(scaled**2)


def adjust(
    views: Views,
    points: Points,
    observations: Observations,
    *,
    fixed: Bool[np.ndarray, " k"],
    freedom: Freedom,
    iterations: int = 10,
    noise_floor_px: float = 0.2,
) -> Adjusted:
    """Views and points with the least robust reprojection error; images in `fixed` keep their pose and zoom.

    The noise scale follows the residuals, so that the loss is robust at the start and sharp at the end; costs before
    and after an accepted step are then on different scales, which `levenberg_marquardt` does not provide for. The gauge
    is left to the damping: fix at least one image.
    """
    residual = residuals(views, points, observations)
    noise = noise_of(residual, noise_floor_px)
    cost = float(robust_loss(residual, noise).sum())
    damping = 1e-4
    layout = _Layout(observations, len(fixed), len(points.rho))
    system: _System | None = None
    for _ in range(iterations):
        system = system or _System(views, points, observations, layout, fixed, freedom, noise)
        new_views, new_points = system.step(views, points, damping)
        new_residual = residuals(new_views, new_points, observations)
        new_cost = float(robust_loss(new_residual, noise).sum())
        if not new_cost < cost:
            damping *= 10.0
            if damping > 1e4:
                break
            continue
        gain = (cost - new_cost) / max(cost, 1e-12)
        views, points, residual = new_views, new_points, new_residual
        damping = max(damping / 10.0, 1e-10)
        noise = noise_of(residual, noise_floor_px)
        cost = float(robust_loss(residual, noise).sum())
        if gain < MIN_GAIN:
            break
        system = None
    return Adjusted(views, points, residual, cost, noise)


def focal_step(
    solution: Adjusted, observations: Observations, *, fixed: Bool[np.ndarray, " k"], freedom: Freedom
) -> tuple[float, float]:
    """Newton step of ln(focal) at an adjusted solution with everything else following, and its standard deviation.

    The focal length hides in a nearly flat, curved valley of all parameters together, in which Levenberg-Marquardt
    creeps. Eliminating the rest (variable projection) leaves a scalar problem that is close to quadratic; the caller
    takes the step, carries the solution over (`with_focal`) and adjusts again.
    """
    step, covariance = lens_step(solution, observations, fixed=fixed, freedom=freedom)
    return float(step[0]), float(np.sqrt(covariance[0, 0]))


def lens_step(
    solution: Adjusted,
    observations: Observations,
    *,
    fixed: Bool[np.ndarray, " k"],
    freedom: Freedom,
    beside: Float[np.ndarray, "m 2 e"] | None = None,
) -> tuple[Float[np.ndarray, " 1+e"], Float[np.ndarray, "1+e 1+e"]]:
    """The same Newton step of ln(focal) together with e more parameters of the lens, and its covariance.

    `beside`: how the pixel that is expected of each sighting changes with each of them.
    """
    layout = _Layout(observations, len(fixed), len(solution.points.rho))
    more = np.zeros((len(observations.image), 2, 0)) if beside is None else beside
    return _System(
        solution.views, solution.points, observations, layout, fixed, freedom, solution.noise_px, beside=more
    ).lens_step()


class _Layout:
    """Who sees what, arranged once for all iterations."""

    def __init__(self, observations: Observations, num_images: int, num_points: int) -> None:
        count = np.arange(len(observations.image))
        ones = np.ones(len(count))
        self.by_image = csr_matrix((ones, (observations.image, count)), shape=(num_images, len(count)))
        self.by_point = csr_matrix((ones, (observations.point, count)), shape=(num_points, len(count)))
        self.order = np.argsort(observations.image, kind="stable")
        self.indptr = np.searchsorted(observations.image[self.order], np.arange(num_images + 1))
        self.column = observations.point[self.order]


def _sum_by(gather: csr_matrix, values: np.ndarray) -> np.ndarray:
    """Sums of the rows of `values` that belong together."""
    return np.asarray(gather @ values.reshape(len(values), -1)).reshape(gather.shape[0], *values.shape[1:])


class _System:
    """The normal equations at one point of the parameter space."""

    def __init__(
        self,
        views: Views,
        points: Points,
        observations: Observations,
        layout: _Layout,
        fixed: np.ndarray,
        freedom: Freedom,
        noise_px: float,
        beside: Float[np.ndarray, "m 2 e"] | None = None,
    ) -> None:
        """`beside`: as in `lens_step`; None where no parameter of the lens is asked for."""
        self.freedom, self.fixed, self.t_shot_cam = freedom, fixed, views.t_shot_cam
        self.num_images, self.num_points = len(fixed), len(points.rho)
        q, xy = project(views, points, observations)
        front = q[:, 2] > MIN_DEPTH
        error = np.where(front[:, None], observations.xy - xy, 0.0)
        squared = (error**2).sum(1) / (2.0 * noise_px) ** 2
        weight = np.where(front, cauchy_weight(squared), 0.0) / noise_px**2
        self.tangent = _tangents(points.direction)
        J_image, J_point, J_focal = self._jacobians(views, points, observations, q, front)

        weighted_image = np.swapaxes(J_image, 1, 2) * weight[:, None, None]
        weighted_point = np.swapaxes(J_point, 1, 2) * weight[:, None, None]
        width, depth = J_image.shape[2], J_point.shape[2]
        self.width = width
        by_image = weighted_image @ J_image
        self.U = _sum_by(layout.by_image, by_image)
        self.g_image = _sum_by(layout.by_image, np.einsum("mir,mr->mi", weighted_image, error))
        self.V = _sum_by(layout.by_point, weighted_point @ J_point)
        self.g_point = _sum_by(layout.by_point, np.einsum("mir,mr->mi", weighted_point, error))
        coupling = weighted_image @ J_point
        self.layout = layout
        self.W = bsr_matrix(
            (coupling[layout.order], layout.column, layout.indptr),
            shape=(self.num_images * width, self.num_points * depth),
        )
        if beside is not None:
            J_lens = np.concatenate([J_focal[..., None], beside], axis=-1)
            weighted_lens = J_lens * weight[:, None, None]
            self.lens_curvature = np.einsum("mrl,mrk->lk", weighted_lens, J_lens)
            self.g_lens = np.einsum("mrl,mr->l", weighted_lens, error)
            self.lens_image = _sum_by(layout.by_image, weighted_image @ J_lens)
            self.lens_point = _sum_by(layout.by_point, weighted_point @ J_lens)

    def _jacobians(
        self, views: Views, points: Points, observations: Observations, q: np.ndarray, front: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """d pixel / d (rotation, centre, zoom) (M,2,·), d pixel / d (direction, ρ) (M,2,·), d pixel / d ln f (M,2)."""
        image, point = observations.image, observations.point
        J_image, from_shot = image_jacobian(views, points.rho, observations, q, front, self.freedom)
        J_point = np.empty((len(q), 2, 3 if self.freedom.translation else 2))
        J_point[:, :, :2] = from_shot @ self.tangent[point]
        if self.freedom.translation:
            offset = points.anchor[point] - views.t_shot_cam[image]
            J_point[:, :, 2] = np.einsum("mri,mi->mr", from_shot, offset)
        planar = q[:, :2] / np.where(front, q[:, 2], 1.0)[:, None]
        return J_image, J_point, views.focals_px[image, None] * planar

    def _reduced(self, damping: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, bsr_matrix]:
        """Reduced camera matrix and right side, the inverted point blocks, and W V⁻¹."""
        V = self.V.copy()
        diagonal = np.einsum("pii->pi", V)
        diagonal += damping * diagonal + 1e-9 * max(float(diagonal.max(initial=0.0)), 1.0)
        V_inverse = np.linalg.inv(V)
        column = self.layout.column
        Y = bsr_matrix((self.W.data @ V_inverse[column], column, self.layout.indptr), shape=self.W.shape)
        S = -np.asarray((Y @ self.W.T).todense())
        width = self.width
        U = self.U.copy()
        diagonal = np.einsum("kii->ki", U)
        diagonal += damping * diagonal + 1e-9
        blocks = S.reshape(self.num_images, width, self.num_images, width)
        index = np.arange(self.num_images)
        blocks[index, :, index, :] += U
        right = self.g_image.reshape(-1) - Y @ self.g_point.reshape(-1)
        return S, right, V_inverse, Y

    def _free(self) -> np.ndarray:
        """Which parameters may move; with a single fixed image, one coordinate of the farthest one holds the scale."""
        free = np.repeat(~self.fixed, self.width)
        if self.freedom.translation and self.fixed.sum() == 1 and len(self.fixed) > 1:
            offset = np.abs(self.t_shot_cam - self.t_shot_cam[self.fixed])
            image, axis = np.unravel_index(np.argmax(offset), offset.shape)
            free[image * self.width + 3 + axis] = False
        return free

    def step(self, views: Views, points: Points, damping: float) -> tuple[Views, Points]:
        """Views and points after one damped Gauss-Newton step."""
        S, right, V_inverse, _ = self._reduced(damping)
        free = self._free()
        delta = np.zeros(len(right))
        delta[free] = _solve(S[np.ix_(free, free)], right[free])
        g_point = self.g_point - (self.W.T @ delta).reshape(self.num_points, -1)
        by_point = np.einsum("pij,pj->pi", V_inverse, g_point)
        by_image = delta.reshape(self.num_images, self.width)
        return self._moved_views(views, by_image), self._moved_points(points, by_point)

    def _moved_views(self, views: Views, delta: np.ndarray) -> Views:
        R = views.R_shot_cam @ rotations.rotvec_to_rotmat(np.clip(delta[:, :3], -0.5, 0.5))
        moved = replace(views, R_shot_cam=R)
        if self.freedom.translation:
            moved = replace(moved, t_shot_cam=views.t_shot_cam + delta[:, 3:6])
        if self.freedom.zoom:
            moved = replace(moved, log_zoom=views.log_zoom + np.clip(delta[:, -1], -0.5, 0.5))
        return moved

    def _moved_points(self, points: Points, delta: np.ndarray) -> Points:
        direction = points.direction + np.einsum("pij,pj->pi", self.tangent, delta[:, :2])
        length = np.linalg.norm(direction, axis=1)
        rho = points.rho + delta[:, 2] if self.freedom.translation else points.rho
        return Points(direction / length[:, None], rho / length, points.anchor)

    def lens_step(self) -> tuple[np.ndarray, np.ndarray]:
        """Undamped step of the lens' parameters and its covariance, after views and points are eliminated."""
        S, right, V_inverse, Y = self._reduced(0.0)
        free, num = self._free(), len(self.g_lens)
        side = (self.lens_image.reshape(-1, num) - Y @ self.lens_point.reshape(-1, num))[free]
        of_points = np.einsum("pil,pij->plj", self.lens_point, V_inverse)
        curvature = self.lens_curvature - np.einsum("plj,pjk->lk", of_points, self.lens_point)
        gradient = self.g_lens - np.einsum("plj,pj->l", of_points, self.g_point)
        followed = _solve(S[np.ix_(free, free)], np.column_stack([side, right[free]]))
        curvature -= side.T @ followed[:, :num]
        gradient -= side.T @ followed[:, num]
        along, axes = np.linalg.eigh(curvature)
        covariance = (axes / np.maximum(along, 1e-9)) @ axes.T
        return covariance @ gradient, covariance


def _solve(S: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solution of a symmetric system after scaling its diagonal to one."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(S), 1e-12))
    scaled = S * np.outer(scale, scale) + 1e-12 * np.eye(len(S))
    right = (scale * right.T).T
    return np.asarray((scale * np.linalg.solve(scaled, right).T).T)


def image_jacobian(
    views: Views,
    rho: Float[np.ndarray, " p"],
    observations: Observations,
    q: Float[np.ndarray, "m 3"],
    front: Bool[np.ndarray, " m"],
    freedom: Freedom,
) -> tuple[Float[np.ndarray, "m 2 c"], Float[np.ndarray, "m 2 3"]]:
    """d pixel / d (rotation, centre, zoom) of each sighting's image, and d pixel / d q rotated into the shot frame.

    Rotations are perturbed on the right, R exp([δ]×), so that dq/dδ = [q]×; written out with x = q_x/q_z, y = q_y/q_z.
    """
    image = observations.image
    focal = views.focals_px[image]
    z = np.where(front, q[:, 2], 1.0)
    x, y = q[:, 0] / z, q[:, 1] / z
    J = np.empty((len(q), 2, 3 + 3 * freedom.translation + freedom.zoom))
    J[:, 0, 0], J[:, 0, 1], J[:, 0, 2] = x * y, -(x * x + 1.0), y
    J[:, 1, 0], J[:, 1, 1], J[:, 1, 2] = y * y + 1.0, -x * y, -x
    J[:, :, :3] *= focal[:, None, None]
    axes = np.swapaxes(views.R_shot_cam[image], 1, 2)
    from_shot = np.empty((len(q), 2, 3))
    from_shot[:, 0] = axes[:, 0] - x[:, None] * axes[:, 2]
    from_shot[:, 1] = axes[:, 1] - y[:, None] * axes[:, 2]
    from_shot *= (focal / z)[:, None, None]
    if freedom.translation:
        J[:, :, 3:6] = -rho[observations.point][:, None, None] * from_shot
    if freedom.zoom:
        J[:, 0, -1], J[:, 1, -1] = focal * x, focal * y
    return J, from_shot


def _tangents(direction: Float[np.ndarray, "p 3"]) -> Float[np.ndarray, "p 3 2"]:
    """Two unit vectors perpendicular to each direction (Duff et al. 2017, branch by the sign of z)."""
    x, y, z = direction.T
    sign = np.where(z >= 0, 1.0, -1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    tangent = np.empty((len(direction), 3, 2))
    tangent[:, 0, 0], tangent[:, 1, 0], tangent[:, 2, 0] = 1.0 + sign * x * x * a, sign * b, -sign * x
    tangent[:, 0, 1], tangent[:, 1, 1], tangent[:, 2, 1] = b, sign + y * y * a, -y
    return tangent
