"""Residuals and Jacobians of the bundle adjustment through a cut (`bundle`), and what it is given.

Measured are the image points of both sides (robust), the pose estimator's 3D points about the mid-hip, and bone lengths
(constant, the same left and right); expected are moderate velocities, accelerations and corrections.

All points are given in the axes of the camera at the cut (its last frame before, its first frame after), so that a
panning camera is already undone; what is left of its translation is one constant velocity between the two sides.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

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
    """What is unknown of one person."""

    motion: Float[Array, "J 3 3"]
    """Position, velocity and acceleration of each point at the cut, in the axes of the camera before it."""
    correction: Float[Array, "2 3 3"]

    def moved(self, step: Float[Array, "unknowns"]) -> "PersonState":
        num = len(self.motion)
        rotations = rotvec_to_rotmat(step[9 * num :].reshape(2, 3))
        return PersonState(self.motion + step[: 9 * num].reshape(num, 3, 3), rotations @ self.correction)


@dataclass(frozen=True)
class CameraState:
    """What is unknown of the camera after the cut."""

    R_before_after: Float[Array, "3 3"]
    shift: Float[Array, "3"]
    """x_after = R_before_afterᵀ x_before + shift."""
    velocity: Float[Array, "3"]

    def moved(self, step: Float[Array, "9"]) -> "CameraState":
        return CameraState(
            self.R_before_after @ rotvec_to_rotmat(step[:3]), self.shift + step[3:6], self.velocity + step[6:9]
        )


class CutProblem:
    """Residuals and Jacobians. Unknowns of a person (motion of each point, two corrections) meet only in the
    camera's nine, so that each person has a Jacobian of its own: own unknowns first, then the camera's."""

    def __init__(self, people: list[PersonAtCut], body: BodyPoints, settings: BundleSettings) -> None:
        self.people, self.body, self.settings = people, body, settings
        self.num_points = people[0].before.rays.shape[1]
        self.per_person = 9 * self.num_points + 6
        self.num_unknowns = self.per_person + CAMERA_UNKNOWNS
        self.bone_a = np.array([a for a, _ in body.bones])
        self.bone_b = np.array([b for _, b in body.bones])

    def linearise(
        self, person: PersonAtCut, state: PersonState, camera: CameraState
    ) -> tuple[Float[Array, "m"], Float[Array, "m unknowns"]]:
        """One person's whitened residuals (robust weights folded in) and their Jacobian."""
        residuals, jacobians = [], []
        for side, view in enumerate((person.before, person.after)):
            r, J = self._side(view, side, state, camera)
            residuals += r
            jacobians += J
        for r_one, J_one in (self._bones(person, state), self._prior(state)):
            residuals.append(r_one)
            jacobians.append(J_one)
        return np.concatenate(residuals), np.concatenate(jacobians)

    def cost(self, states: list[PersonState], camera: CameraState) -> float:
        """½ Σ ρ(residual²), with Huber on the image points."""
        total = 0.0
        for person, state in zip(self.people, states, strict=True):
            for side, view in enumerate((person.before, person.after)):
                image, point = self._side_residuals(view, side, state, camera)
                size = np.linalg.norm(image, axis=-1)
                total += float(huber_loss(size, HUBER).sum() + (point**2).sum())
            total += float((self._bone_residuals(person, state) ** 2).sum())
            total += float((self._prior(state)[0] ** 2).sum())
        return 0.5 * (total + float((camera.velocity**2).sum()) / self.settings.camera_velocity_ms**2)

    def image_residual(self, states: list[PersonState], camera: CameraState) -> float:
        """Weighted median length of the image residuals, in standard deviations of one frame."""
        sizes = []
        for person, state in zip(self.people, states, strict=True):
            for side, view in enumerate((person.before, person.after)):
                image, _ = self._side_residuals(view, side, state, camera)
                seen = view.weight > 0.2
                root_n = np.sqrt(len(view.time_s))
                sizes.append(np.linalg.norm(image, axis=-1)[seen] * root_n / np.sqrt(view.weight[seen]))
        values = np.concatenate(sizes)
        return float(np.median(values)) if len(values) else float("nan")

    def _moving(self, state: PersonState, time_s: Float[Array, "n"]) -> Float[Array, "n J 3"]:
        basis = np.stack([np.ones_like(time_s), time_s, 0.5 * time_s**2], axis=-1)
        return np.asarray(np.einsum("nk,jkc->njc", basis, state.motion))

    def _camera_points(
        self, view: SideView, side: int, state: PersonState, camera: CameraState
    ) -> tuple[Float[Array, "n J 3"], Float[Array, "n J 3"]]:
        """Points in the side's camera, and the same without the translation (for the Jacobian)."""
        X = self._moving(state, view.time_s)
        if side == 0:
            return X, X
        rotated = (X + camera.velocity * view.time_s[:, None, None]) @ camera.R_before_after
        return rotated + camera.shift, rotated

    def _scales(self, view: SideView) -> tuple[Float[Array, "n J 1"], Float[Array, "n J 1"]]:
        # Errors of neighbouring frames are nearly the same error: n frames together weigh like one.
        root = np.sqrt(view.weight / len(view.time_s))[..., None]
        return root / view.sigma_ray, np.sqrt(0.25 + 0.75 * view.weight)[..., None] / (
            self.settings.point_m * np.sqrt(len(view.time_s))
        )

    def _side_residuals(
        self, view: SideView, side: int, state: PersonState, camera: CameraState
    ) -> tuple[Float[Array, "n J 2"], Float[Array, "n J 3"]]:
        Y, rotated = self._camera_points(view, side, state, camera)
        ray_scale, point_scale = self._scales(view)
        image = (Y[..., :2] / np.maximum(Y[..., 2:], 0.1) - view.rays) * ray_scale
        a, b = self.body.hips
        relative = rotated - 0.5 * (rotated[:, a : a + 1] + rotated[:, b : b + 1])
        return image, (relative @ state.correction[side].T - view.points) * point_scale

    def _side(
        self, view: SideView, side: int, state: PersonState, camera: CameraState
    ) -> tuple[list[Array], list[Array]]:
        n, num = view.weight.shape
        Y, rotated = self._camera_points(view, side, state, camera)
        ray_scale, point_scale = self._scales(view)
        image, point = self._side_residuals(view, side, state, camera)
        robust = np.sqrt(huber_weight(np.linalg.norm(image, axis=-1, keepdims=True), HUBER))
        image, ray_scale = image * robust, ray_scale * robust
        z = np.maximum(Y[..., 2], 0.1)
        projection = np.zeros((n, num, 2, 3))
        projection[..., 0, 0] = projection[..., 1, 1] = 1 / z
        projection[..., 0, 2], projection[..., 1, 2] = -Y[..., 0] / z**2, -Y[..., 1] / z**2
        projection *= ray_scale[..., None]
        to_camera = np.eye(3) if side == 0 else camera.R_before_after.T
        basis = np.stack([np.ones(n), view.time_s, 0.5 * view.time_s**2], axis=-1)

        J_image = np.zeros((n, num, 2, self.num_unknowns))
        J_point = np.zeros((n, num, 3, self.num_unknowns))
        shared = self.per_person
        C = state.correction[side]
        d_image = projection @ to_camera
        d_point = np.broadcast_to(C @ to_camera, (n, num, 3, 3)) * point_scale[..., None]
        block = np.einsum("njac,nk->njakc", d_image, basis).reshape(n, num, 2, 9)
        block3 = np.einsum("njac,nk->njakc", d_point, basis).reshape(n, num, 3, 9)
        for j in range(num):
            J_image[:, j, :, 9 * j : 9 * j + 9] = block[:, j]
            J_point[:, j, :, 9 * j : 9 * j + 9] = block3[:, j]
        for hip in self.body.hips:
            J_point[..., 9 * hip : 9 * hip + 9] -= 0.5 * block3
        a, b = self.body.hips
        relative = rotated - 0.5 * (rotated[:, a : a + 1] + rotated[:, b : b + 1])
        rotation = slice(9 * num + 3 * side, 9 * num + 3 * side + 3)
        J_point[..., rotation] = -skew(relative @ C.T) * point_scale[..., None]
        if side == 1:
            J_image[..., shared : shared + 3] = projection @ skew(rotated)
            J_image[..., shared + 3 : shared + 6] = projection
            J_image[..., shared + 6 : shared + 9] = d_image * view.time_s[:, None, None, None]
            J_point[..., shared : shared + 3] = C @ skew(relative) * point_scale[..., None]
        return [image.ravel(), point.ravel()], [
            J_image.reshape(-1, self.num_unknowns),
            J_point.reshape(-1, self.num_unknowns),
        ]

    def _bone_times(self, person: PersonAtCut) -> Float[Array, "3"]:
        return np.array([person.before.time_s[0], 0.0, person.after.time_s[-1]])

    def _bone_residuals(self, person: PersonAtCut, state: PersonState) -> Float[Array, "3 B"]:
        X = self._moving(state, self._bone_times(person))
        length = np.linalg.norm(X[:, self.bone_a] - X[:, self.bone_b], axis=-1)
        return np.asarray((length - person.bone_lengths) / self.settings.bone_m)

    def _bones(self, person: PersonAtCut, state: PersonState) -> tuple[Float[Array, "m"], Float[Array, "m unknowns"]]:
        times = self._bone_times(person)
        X = self._moving(state, times)
        offset = X[:, self.bone_a] - X[:, self.bone_b]
        length = np.maximum(np.linalg.norm(offset, axis=-1, keepdims=True), 1e-3)
        direction = offset / length / self.settings.bone_m
        basis = np.stack([np.ones(3), times, 0.5 * times**2], axis=-1)
        block = np.einsum("tbc,tk->tbkc", direction, basis).reshape(3, -1, 9)
        J = np.zeros((3, len(self.bone_a), self.num_unknowns))
        for bone, (a, b) in enumerate(self.body.bones):
            J[:, bone, 9 * a : 9 * a + 9] = block[:, bone]
            J[:, bone, 9 * b : 9 * b + 9] = -block[:, bone]
        return self._bone_residuals(person, state).ravel(), J.reshape(-1, self.num_unknowns)

    def _prior(self, state: PersonState) -> tuple[Float[Array, "m"], Float[Array, "m unknowns"]]:
        """Moderate velocities, accelerations and corrections."""
        settings = self.settings
        weight = np.zeros((self.num_points, 3, 3))
        weight[:, 1], weight[:, 2] = 1 / settings.velocity_ms, 1 / settings.acceleration_ms2
        rotation = np.full(6, np.sqrt(3) / np.deg2rad(settings.orientation_deg))
        weights = np.concatenate([weight.ravel(), rotation])
        values = np.concatenate([state.motion.ravel(), rotmat_to_rotvec(state.correction).ravel()])
        used = np.flatnonzero(weights)
        J = np.zeros((len(used), self.num_unknowns))
        J[np.arange(len(used)), used] = weights[used]
        return weights[used] * values[used], J

    def normal(
        self, states: list[PersonState], camera: CameraState
    ) -> list[tuple[Float[Array, "unknowns"], Float[Array, "unknowns unknowns"]]]:
        """Gradient and Gauss-Newton Hessian of each person; the camera's prior is added to the first."""
        parts = []
        for person, state in zip(self.people, states, strict=True):
            residuals, J = self.linearise(person, state, camera)
            parts.append((J.T @ residuals, J.T @ J))
        weight = 1 / self.settings.camera_velocity_ms**2
        gradient, hessian = parts[0]
        gradient[-3:] += weight * camera.velocity
        hessian[-3:, -3:] += weight * np.eye(3)
        return parts
