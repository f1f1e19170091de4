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

    motion: Float[Array, "3 J 3"]
    """Position, velocity and acceleration of each point at the cut, in the axes of the camera before it."""
    correction: Float[Array, "2 3 3"]

    def moved(self, step: Float[Array, "unknowns"]) -> "PersonState":
        of_motion, of_correction = np.split(step, [self.motion.size])
        rotations = rotvec_to_rotmat(of_correction.reshape(2, 3))
        return PersonState(self.motion + of_motion.reshape(self.motion.shape), rotations @ self.correction)


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
    """Cost and Gauss-Newton equations.

    Unknowns of a person (motion of each point, two corrections) meet only in the camera's nine, so that each person has
    equations of his own: own unknowns first, then the camera's. A residual of one moment sees the motion only by where
    the points are then: derivatives are taken by these positions, and by corrections and camera (`_OTHERS`); the
    positions of all moments are expanded to the motion at the end.
    """

    def __init__(self, people: list[PersonAtCut], body: BodyPoints, settings: BundleSettings) -> None:
        self.people, self.settings = people, settings
        self.num_points = people[0].before.rays.shape[1]
        self.bone_a, self.bone_b = np.array(body.bones).T
        self.about_hips = np.eye(self.num_points)
        """(J, J): times points, these about the mid-hip."""
        self.about_hips[:, body.hips] -= 0.5
        rotation = np.full(6, np.sqrt(3) / np.deg2rad(settings.orientation_deg))
        of_motion = np.repeat([0.0, 1 / settings.velocity_ms, 1 / settings.acceleration_ms2], 3 * self.num_points)
        self.prior_weights = np.concatenate([of_motion, rotation])
        """Of a person's unknowns: moderate velocities, accelerations and corrections."""

    def cost(self, states: list[PersonState], camera: CameraState) -> float:
        """½ Σ ρ(residual²), with Huber on the image points."""
        total = 0.0
        for person, state in zip(self.people, states, strict=True):
            for side, view in enumerate((person.before, person.after)):
                image, point = self._side_residuals(view, side, state, camera)
                size = np.linalg.norm(image, axis=-1)
                total += float(huber_loss(size, HUBER).sum() + (point**2).sum())
            total += float((self._bones(person, state)[0] ** 2).sum())
            total += float((self._prior(state) ** 2).sum())
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

    def normal(
        self, states: list[PersonState], camera: CameraState
    ) -> list[tuple[Float[Array, "unknowns"], Float[Array, "unknowns unknowns"]]]:
        """Gradient and Gauss-Newton Hessian of each person; the camera's prior is added to the first."""
        parts = [self._normal_of(person, state, camera) for person, state in zip(self.people, states, strict=True)]
        weight = 1 / self.settings.camera_velocity_ms**2
        gradient, hessian = parts[0]
        gradient[-3:] += weight * camera.velocity
        hessian[-3:, -3:] += weight * np.eye(3)
        return parts

    def _normal_of(
        self, person: PersonAtCut, state: PersonState, camera: CameraState
    ) -> tuple[Float[Array, "unknowns"], Float[Array, "unknowns unknowns"]]:
        """One person's gradient and Gauss-Newton Hessian (robust weights folded in), with his prior."""
        views = (person.before, person.after)
        parts = [
            *(self._side(view, side, state, camera) for side, view in enumerate(views)),
            self._bones(person, state),
        ]
        basis = basis_at(np.concatenate([*(view.time_s for view in views), _bone_times(person)]))
        by_moment = np.concatenate([(residual[:, None] @ rows)[:, 0] for residual, rows in parts])
        squared = np.concatenate([np.swapaxes(rows, -1, -2) @ rows for _, rows in parts])
        num = 3 * self.num_points
        gradient = np.concatenate([(basis.T @ by_moment[:, :num]).ravel(), by_moment[:, num:].sum(axis=0)])
        of_motion = np.tensordot(basis[:, :, None] * basis[:, None], squared[:, :num, :num], (0, 0))
        mixed = np.tensordot(basis, squared[:, :num, num:], (0, 0)).reshape(3 * num, -1)
        of_motion = np.swapaxes(of_motion, 1, 2).reshape(3 * num, 3 * num)
        hessian = np.block([[of_motion, mixed], [mixed.T, squared[:, num:, num:].sum(axis=0)]])
        own = np.arange(len(self.prior_weights))
        gradient[own] += self.prior_weights * self._prior(state)
        hessian[own, own] += self.prior_weights**2
        return gradient, hessian

    def _camera_points(
        self, view: SideView, side: int, state: PersonState, camera: CameraState
    ) -> tuple[Float[Array, "n J 3"], Float[Array, "n J 3"]]:
        """Points in the side's camera, and the same without the translation (for the Jacobian)."""
        X = _moving(state, view.time_s)
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
        return image, (self.about_hips @ rotated @ state.correction[side].T - view.points) * point_scale

    def _side(
        self, view: SideView, side: int, state: PersonState, camera: CameraState
    ) -> tuple[Float[Array, "n 5J"], Float[Array, "n 5J 3J+15"]]:
        """A side's whitened residuals in each frame, robust weights folded in, and their derivatives."""
        n, num = view.weight.shape
        Y, rotated = self._camera_points(view, side, state, camera)
        ray_scale, point_scale = self._scales(view)
        image, point = self._side_residuals(view, side, state, camera)
        robust = np.sqrt(huber_weight(np.linalg.norm(image, axis=-1, keepdims=True), HUBER))
        z = np.maximum(Y[..., 2], 0.1)
        projection = np.zeros((n, num, 2, 3))
        projection[..., 0, 0] = projection[..., 1, 1] = 1 / z
        projection[..., 0, 2], projection[..., 1, 2] = -Y[..., 0] / z**2, -Y[..., 1] / z**2
        projection *= (ray_scale * robust)[..., None]
        to_camera = np.eye(3) if side == 0 else camera.R_before_after.T
        C, relative, each = state.correction[side], self.about_hips @ rotated, np.arange(num)

        by_position, by_other = np.zeros((n, num, 5, num, 3)), np.zeros((n, num, 5, _OTHERS))
        by_image, by_point = by_other[:, :, :2], by_other[:, :, 2:]
        d_image = projection @ to_camera
        by_position[:, each, :2, each] = np.swapaxes(d_image, 0, 1)
        by_position[:, :, 2:] = (self.about_hips * point_scale)[:, :, None, :, None] * (C @ to_camera)[:, None]
        by_point[..., 3 * side : 3 * side + 3] = -skew(relative @ C.T) * point_scale[..., None]
        if side == 1:
            by_image[..., -9:-6] = projection @ skew(rotated)
            by_image[..., -6:-3] = projection
            by_image[..., -3:] = d_image * view.time_s[:, None, None, None]
            by_point[..., -9:-6] = C @ skew(relative) * point_scale[..., None]
        residual = np.concatenate([image * robust, point], axis=-1)
        rows = np.concatenate([by_position.reshape(n, 5 * num, -1), by_other.reshape(n, 5 * num, -1)], axis=-1)
        return residual.reshape(n, -1), rows

    def _bones(self, person: PersonAtCut, state: PersonState) -> tuple[Float[Array, "3 B"], Float[Array, "3 B 3J+15"]]:
        """Whitened residuals of the bones' lengths at three moments, and their derivatives."""
        X = _moving(state, _bone_times(person))
        offset = X[:, self.bone_a] - X[:, self.bone_b]
        length = np.linalg.norm(offset, axis=-1)
        direction = offset / np.maximum(length, 1e-3)[..., None] / self.settings.bone_m
        bones = np.arange(len(self.bone_a))
        by_position = np.zeros((3, len(bones), self.num_points, 3))
        by_position[:, bones, self.bone_a], by_position[:, bones, self.bone_b] = direction, -direction
        rows = np.concatenate([by_position.reshape(3, len(bones), -1), np.zeros((3, len(bones), _OTHERS))], axis=-1)
        return (length - person.bone_lengths) / self.settings.bone_m, rows

    def _prior(self, state: PersonState) -> Float[Array, "own"]:
        """Whitened velocities, accelerations and corrections."""
        return self.prior_weights * np.concatenate([state.motion.ravel(), rotmat_to_rotvec(state.correction).ravel()])


_OTHERS = 6 + CAMERA_UNKNOWNS
"""Unknowns besides the motion: a person's two corrections, and the camera."""


def _bone_times(person: PersonAtCut) -> Float[Array, "3"]:
    """Moments at which bones have their length: first and last picture, and the cut."""
    return np.array([person.before.time_s[0], 0.0, person.after.time_s[-1]])


def basis_at(time_s: Float[Array, " n"]) -> Float[Array, "n 3"]:
    """What position, velocity and acceleration at the cut count for at a moment."""
    return np.stack([np.ones_like(time_s), time_s, 0.5 * time_s**2], axis=-1)


def _moving(state: PersonState, time_s: Float[Array, " n"]) -> Float[Array, "n J 3"]:
    """Where the points are at each moment."""
    return np.tensordot(basis_at(time_s), state.motion, (1, 0))
