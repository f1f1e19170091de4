"""Residuals and their derivatives of the bundle adjustment through a cut (`bundle`), and what it is given.

Measured are the image points of both sides (robust), the pose estimator's 3D points about the mid-hip, and bone lengths
(constant, the same left and right); expected are moderate velocities, accelerations and corrections.

All points are given in the axes of the camera at the cut (its last frame before, its first frame after), so that a
panning camera is already undone; what is left of its translation is one constant velocity between the two sides.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from humanmm.models.geometry.robust import huber_loss, huber_weight
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat, skew

Array = np.ndarray


@dataclass(frozen=True)
class BodyPoints:
    """Which body points take part."""

    hips: tuple[int, int]
    """Their middle is the origin of the 3D points."""
    bones: tuple[tuple[int, int], ...]
    """Pairs of points of nearly constant distance."""


@dataclass(frozen=True)
class SideView:
    """One person on one side of a cut: n frames, J points, in the axes of that side's camera at the cut."""

    time_s: Float[Array, "n"]
    """Seconds from the cut: negative before, positive after."""
    rays: Float[Array, "n J 2"]
    """x/z and y/z of the image points."""
    weight: Float[Array, "n J"]
    """0..1, visibility."""
    points: Float[Array, "n J 3"]
    """The estimator's 3D points about the mid-hip, metres."""
    origin: Float[Array, "n 3"]
    """Mid-hip in camera axes, metres (start values only)."""
    sigma_ray: float
    """Standard deviation of the image points, as x/z."""


@dataclass(frozen=True)
class PersonAtCut:
    """One person seen on both sides."""

    before: SideView
    after: SideView
    bone_lengths: Float[Array, "B"]
    """Metres, of `BodyPoints.bones`."""


@dataclass(frozen=True)
class BundleSettings:
    """Standard deviations of the measurements and priors."""

    point_m: float = 0.08
    """Error of the estimator's 3D points, which hardly averages out over the window."""
    orientation_deg: float = 12.0
    """Orientation error of the estimator on one side."""
    bone_m: float = 0.02
    acceleration_ms2: float = 15.0
    velocity_ms: float = 3.0
    camera_velocity_ms: float = 0.02
    """Difference of the two cameras' velocities that is not undone yet."""
    max_iterations: int = 25


HUBER = 1.5
"""In standard deviations: beyond it an image residual counts linearly."""


CAMERA_UNKNOWNS = 9
"""Rotation, shift and velocity of the camera after the cut."""


@dataclass(frozen=True)
class PersonState:
    """What is unknown of one person, in S runs."""

    motion: Float[Array, "S 3 J 3"]
    """Position, velocity and acceleration of each point at the cut, in the axes of the camera before it."""
    correction: Float[Array, "S 2 3 3"]
    """What the pose estimator's orientation is off by, before and after the cut: rotates points about the mid-hip from
    the axes of the side's camera to where the estimator has them."""

    def moved(self, step: Float[Array, "S own"]) -> "PersonState":
        of_motion, of_correction = step[:, :-6], step[:, -6:]
        rotations = rotvec_to_rotmat(of_correction.reshape(-1, 2, 3))
        return PersonState(self.motion + of_motion.reshape(self.motion.shape), rotations @ self.correction)


@dataclass(frozen=True)
class CameraState:
    """What is unknown of the camera after the cut, in S runs."""

    R_before_after: Float[Array, "S 3 3"]
    shift: Float[Array, "S 3"]
    """x_after = R_before_afterᵀ x_before + shift."""
    velocity: Float[Array, "S 3"]

    def moved(self, step: Float[Array, "S 9"]) -> "CameraState":
        return CameraState(
            self.R_before_after @ rotvec_to_rotmat(step[:, :3]), self.shift + step[:, 3:6], self.velocity + step[:, 6:]
        )


@dataclass(frozen=True)
class MotionHessian:
    """Second derivatives of S runs by the motion of one person, as long as possible without the large matrices."""

    constant: Float[Array, "3 J 3 3 J 3"]
    """What is the same in all states: of the 3D points, whose other unknowns are rotations, and of the prior."""
    of_points: Float[Array, "S 9 J 9"]
    """Each point's with itself, by pairs of position, velocity and acceleration and by pairs of axes."""
    of_bones: Float[Array, "S 9 B 9"]
    """The same of the points at the two ends of each bone, but for the sign."""
    bones: Int[Array, "2 B"]

    def matrix(self, run: int) -> Float[Array, "9J 9J"]:
        """All of one run."""
        motion, each = self.constant.copy(), np.arange(self.constant.shape[1])
        of_points, of_bones = (
            part[run].reshape(3, 3, -1, 3, 3).transpose(2, 0, 3, 1, 4) for part in (self.of_points, self.of_bones)
        )
        motion[:, each, :, :, each] += of_points
        for first, second in (self.bones, self.bones[::-1]):
            motion[:, first, :, :, second] -= of_bones
        return motion.reshape(9 * len(each), -1)


@dataclass(frozen=True)
class PersonEquations:
    """Blocks of the Hessian of one person's unknowns and the camera's, in S runs; the last column is the gradient."""

    motion: MotionHessian
    mixed: Float[Array, "S 9J 16"]
    """Motion and others: two corrections (6), the camera (9)."""
    others: Float[Array, "S 16 16"]
    """The last row is unused."""


class CutProblem:
    """Cost and Newton equations, of S runs at once.

    Unknowns of a person (motion of each point, two corrections) meet others' only in the camera's nine. At any moment,
    pictures and bones see the motion only by where the points are then: derivatives are taken by these positions, and
    expanded to the motion at the end.
    """

    def __init__(self, people: list[PersonAtCut], body: BodyPoints, settings: BundleSettings) -> None:
        self.people, self.settings = people, settings
        self.num_points = num = people[0].before.rays.shape[1]
        self.about_hips = np.eye(num)
        """(J, J): times points, these about the mid-hip."""
        self.about_hips[:, body.hips] -= 0.5
        self.bones = np.array(body.bones).T
        """(2, B): the points that bones join."""
        self.along_bone = np.eye(num)[self.bones[0]] - np.eye(num)[self.bones[1]]
        """(B, J): times points, the vectors of the bones."""
        rotation = np.full(6, np.sqrt(3) / np.deg2rad(settings.orientation_deg))
        of_motion = np.repeat([0.0, 1 / settings.velocity_ms, 1 / settings.acceleration_ms2], 3 * num)
        self.prior_weights = np.concatenate([of_motion, rotation])
        """Of a person's unknowns: moderate velocities, accelerations and corrections."""
        self.constant = [self._constant(person) for person in people]

    def cost(self, states: list[PersonState], camera: CameraState) -> Float[Array, " S"]:
        """½ Σ ρ(residual²), with Huber on the image points."""
        total = (camera.velocity**2).sum(axis=-1) / self.settings.camera_velocity_ms**2
        for person, state in zip(self.people, states, strict=True):
            for side, view in enumerate((person.before, person.after)):
                image, point = self._side_residuals(view, side, state, camera)
                size = np.linalg.norm(image, axis=-1)
                total += huber_loss(size, HUBER).sum(axis=(1, 2)) + (point**2).sum(axis=(1, 2, 3))
            total += (self._bones(person, state)[0] ** 2).sum(axis=(1, 2)) + (self._prior(state) ** 2).sum(axis=1)
        return np.asarray(0.5 * total)

    def image_residual(self, states: list[PersonState], camera: CameraState) -> Float[Array, " S"]:
        """Weighted median length of the image residuals, in standard deviations of one frame."""
        sizes = []
        for person, state in zip(self.people, states, strict=True):
            for side, view in enumerate((person.before, person.after)):
                image, _ = self._side_residuals(view, side, state, camera)
                seen = view.weight > 0.2
                root_n = np.sqrt(len(view.time_s))
                sizes.append(np.linalg.norm(image, axis=-1)[:, seen] * root_n / np.sqrt(view.weight[seen]))
        values = np.concatenate(sizes, axis=1)
        return np.median(values, axis=1) if values.size else np.full(len(values), np.nan)

    def equations(self, states: list[PersonState], camera: CameraState) -> list["PersonEquations"]:
        """Of each person; the camera's prior is added to the first.

        The Hessian is that of Gauss and Newton; stretched bones have their second derivative as well, without which
        points that turn about their neighbour overshoot.
        """
        parts = [self._equations_of(k, state, camera) for k, state in enumerate(states)]
        weight = 1 / self.settings.camera_velocity_ms**2
        of_velocity = parts[0].others[:, _VELOCITY]
        of_velocity[:, :, -1] += weight * camera.velocity
        of_velocity[:, :, _VELOCITY] += weight * np.eye(3)
        return parts

    def _equations_of(self, number: int, state: PersonState, camera: CameraState) -> "PersonEquations":
        """One person's equations (robust weights folded in), with his prior."""
        person, num = self.people[number], self.num_points
        runs = len(state.motion)
        residual, direction, curvature = self._bones(person, state)
        basis = basis_at(_bone_times(person))
        mixed, others = np.zeros((runs, 3, num, 3, _OTHERS + 1)), np.zeros((runs, _OTHERS + 1, _OTHERS + 1))
        mixed[..., -1] = _weighted(basis, self.along_bone.T @ (residual[..., None] * direction))
        of_bones = _weighted(_pairs(basis), curvature.reshape(*residual.shape, 9))
        of_points = np.abs(self.along_bone).T @ of_bones
        for side, view in enumerate((person.before, person.after)):
            basis = basis_at(view.time_s)
            by_image, by_point, by_other = self._side(view, side, state, camera)
            by_position = np.swapaxes(by_image, -1, -2) @ by_other[..., :2, :]
            about_hips = np.swapaxes(by_point, -1, -2) @ by_other[..., 2:, :]
            by_position += (self.about_hips.T @ about_hips.reshape(*about_hips.shape[:3], -1)).reshape(about_hips.shape)
            mixed += _weighted(basis, by_position)
            squared = np.swapaxes(by_image, -1, -2) @ by_image
            of_points += _weighted(_pairs(basis), squared.reshape(*squared.shape[:3], 9))
            rows = by_other.reshape(runs, -1, _OTHERS + 1)
            others += np.swapaxes(rows, -1, -2) @ rows
        of_prior, turned = self.prior_weights * self._prior(state), np.arange(6)
        mixed[..., -1] += of_prior[:, :-6].reshape(runs, 3, num, 3)
        others[:, turned, turned] += self.prior_weights[-6:] ** 2
        others[:, :6, -1] += of_prior[:, -6:]
        motion = MotionHessian(self.constant[number], of_points, of_bones, self.bones)
        return PersonEquations(motion, mixed.reshape(runs, 9 * num, -1), others)

    def _constant(self, person: PersonAtCut) -> Float[Array, "3 J 3 3 J 3"]:
        """See `MotionHessian`."""
        num = self.num_points
        total = np.zeros((3, 3, num, num))
        for view in (person.before, person.after):
            scaled = self._scales(view)[1] * self.about_hips
            of_view = np.tensordot(_pairs(basis_at(view.time_s)), np.swapaxes(scaled, -1, -2) @ scaled, (0, 0))
            total += of_view.reshape(total.shape)
        of_points = np.einsum("klij,cd->kicljd", total, np.eye(3))
        return np.asarray(of_points + np.diag(self.prior_weights[:-6] ** 2).reshape(of_points.shape))

    def _camera_points(
        self, view: SideView, side: int, state: PersonState, camera: CameraState
    ) -> tuple[Float[Array, "S n J 3"], Float[Array, "S n J 3"]]:
        """Points in the side's camera, and the same without the translation (for the derivatives)."""
        X = moving(state, view.time_s)
        if side == 0:
            return X, X
        rotated = (X + camera.velocity[:, None, None] * view.time_s[:, None, None]) @ camera.R_before_after[:, None]
        return rotated + camera.shift[:, None, None], rotated

    def _scales(self, view: SideView) -> tuple[Float[Array, "n J 1"], Float[Array, "n J 1"]]:
        """What residuals are times, so that they are in standard deviations: of the image points (x/z) and of the 3D
        points (1/m). Points that are not visible have no image residual, but half of one in space."""
        # Errors of neighbouring frames are nearly the same error: n frames together weigh like one.
        root = np.sqrt(view.weight / len(view.time_s))[..., None]
        return root / view.sigma_ray, np.sqrt(0.25 + 0.75 * view.weight)[..., None] / (
            self.settings.point_m * np.sqrt(len(view.time_s))
        )

    def _side_residuals(
        self, view: SideView, side: int, state: PersonState, camera: CameraState
    ) -> tuple[Float[Array, "S n J 2"], Float[Array, "S n J 3"]]:
        """Whitened residuals of one side: of the image points, not yet robust, and of the 3D points about the mid-hip.
        `side`: 0 before the cut, 1 after."""
        Y, rotated = self._camera_points(view, side, state, camera)
        ray_scale, point_scale = self._scales(view)
        image = (Y[..., :2] / np.maximum(Y[..., 2:], 0.1) - view.rays) * ray_scale
        corrected = self.about_hips @ rotated @ np.swapaxes(state.correction[:, None, side], -1, -2)
        return image, (corrected - view.points) * point_scale

    def _side(
        self, view: SideView, side: int, state: PersonState, camera: CameraState
    ) -> tuple[Float[Array, "S n J 2 3"], Float[Array, "S n J 3 3"], Float[Array, "S n J 5 16"]]:
        """Derivatives of a side's whitened residuals, robust weights folded in.

        Of the image points by the points' positions, of the 3D points by the positions about the mid-hip, and of both
        together by `_OTHERS`; the last column holds the residuals.
        """
        Y, rotated = self._camera_points(view, side, state, camera)
        ray_scale, point_scale = self._scales(view)
        image, point = self._side_residuals(view, side, state, camera)
        robust = np.sqrt(huber_weight(np.linalg.norm(image, axis=-1, keepdims=True), HUBER))
        z = np.maximum(Y[..., 2], 0.1)
        projection = np.zeros((*z.shape, 2, 3))
        projection[..., 0, 0] = projection[..., 1, 1] = 1 / z
        projection[..., 0, 2], projection[..., 1, 2] = -Y[..., 0] / z**2, -Y[..., 1] / z**2
        projection *= (ray_scale * robust)[..., None]
        C, relative = state.correction[:, None, None, side], self.about_hips @ rotated
        by_image, by_point = projection, C * point_scale[..., None]
        by_other = np.zeros((*z.shape, 5, _OTHERS + 1))
        of_image, of_point = by_other[..., :2, :], by_other[..., 2:, :]
        of_point[..., 3 * side : 3 * side + 3] = -skew((C @ relative[..., None])[..., 0]) * point_scale[..., None]
        if side == 1:
            to_camera = np.swapaxes(camera.R_before_after, -1, -2)[:, None, None]
            by_image, by_point = projection @ to_camera, by_point @ to_camera
            of_image[..., 6:9], of_image[..., 9:12] = projection @ skew(rotated), projection
            of_image[..., 12:15] = by_image * view.time_s[:, None, None, None]
            of_point[..., 6:9] = C @ skew(relative) * point_scale[..., None]
        of_image[..., -1], of_point[..., -1] = image * robust, point
        return by_image, by_point, by_other

    def _bones(
        self, person: PersonAtCut, state: PersonState
    ) -> tuple[Float[Array, "S 3 B"], Float[Array, "S 3 B 3"], Float[Array, "S 3 B 3 3"]]:
        """Whitened residuals of the bones' lengths at three moments, and first and second derivative by the bones'
        vectors of half their squares."""
        offset = self.along_bone @ moving(state, _bone_times(person))
        length = np.linalg.norm(offset, axis=-1)
        residual = (length - person.bone_lengths) / self.settings.bone_m
        safe = np.maximum(length, 1e-3)[..., None]
        direction = offset / safe / self.settings.bone_m
        along = direction[..., :, None] * direction[..., None, :]
        across = np.eye(3) / self.settings.bone_m**2 - along
        # A bone that is too short is pushed apart: its curvature is negative, and left out.
        stretch = np.maximum(residual[..., None], 0) * self.settings.bone_m / safe
        return residual, direction, along + stretch[..., None] * across

    def _prior(self, state: PersonState) -> Float[Array, "S own"]:
        """Whitened velocities, accelerations and corrections."""
        runs = len(state.motion)
        correction = rotmat_to_rotvec(state.correction)
        values = np.concatenate([state.motion.reshape(runs, -1), correction.reshape(runs, -1)], axis=1)
        return np.asarray(self.prior_weights * values)


_OTHERS = 6 + CAMERA_UNKNOWNS
"""Unknowns besides the motion: a person's two corrections, and the camera."""
_VELOCITY = slice(_OTHERS - 3, _OTHERS)
"""The camera's velocity among them."""


def _bone_times(person: PersonAtCut) -> Float[Array, "3"]:
    """Moments at which bones have their length: first and last picture, and the cut."""
    return np.array([person.before.time_s[0], 0.0, person.after.time_s[-1]])


def basis_at(time_s: Float[Array, " n"]) -> Float[Array, "n 3"]:
    """What position, velocity and acceleration at the cut count for at a moment."""
    return np.stack([np.ones_like(time_s), time_s, 0.5 * time_s**2], axis=-1)


def moving(state: PersonState, time_s: Float[Array, " n"]) -> Float[Array, "S n J 3"]:
    """Where the points are at each moment."""
    return _weighted(basis_at(time_s).T, state.motion)


def _pairs(basis: Float[Array, "n 3"]) -> Float[Array, "n 9"]:
    """What pairs of them count for."""
    return np.asarray((basis[:, :, None] * basis[:, None]).reshape(len(basis), 9))


def _weighted(weights: Float[Array, "n m"], values: Float[Array, "S n *rest"]) -> Float[Array, "S m *rest"]:
    """Sums over the second axis."""
    runs, n, *rest = values.shape
    return np.asarray((weights.T @ values.reshape(runs, n, -1)).reshape(runs, -1, *rest))
