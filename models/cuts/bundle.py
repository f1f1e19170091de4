"""Small bundle adjustment through a cut: the people's motion runs on, only the camera changes (paper 3.3.1,
assumption 1).

Unknown are the quadratic motion of each body point through the cut, the rotation and translation between the two
cameras, and one orientation correction of the pose estimator for each person and side: its landmarks are off by a
slowly varying rotation of several degrees, which averaging over frames cannot remove but the other view can.
Measured are the image points of both sides (robust), the estimator's 3D points about the mid-hip, and bone lengths
(constant, the same left and right). Levenberg-Marquardt with analytic Jacobians; the caller gives the starts.

All points are given in the axes of the camera at the cut (its last frame before, its first frame after), so that a
panning camera is already undone; what is left of its translation is one constant velocity between the two sides.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from humanmm.models.geometry.rotations import rotation_from_vector, skew, vector_from_rotation

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
    """One sigma of the image points, as x/z."""


@dataclass(frozen=True)
class PersonAtCut:
    """One person seen on both sides."""

    before: SideView
    after: SideView
    bone_lengths: Float[Array, "B"]
    """Metres, of `BodyPoints.bones`."""


@dataclass(frozen=True)
class BundleSettings:
    """Sigmas of the measurements and priors."""

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


@dataclass(frozen=True)
class BundleResult:
    """Relative camera pose at the cut."""

    R_before_after: Float[Array, "3 3"]
    t_before_after: Float[Array, "3"]
    """Centre of the camera after the cut in the axes of the one before it, metres."""
    cost: float
    residual_px_ratio: float
    """Robust mean of the image residuals, in units of sigma_ray."""
    corrections: tuple[tuple[Float[Array, "3 3"], Float[Array, "3 3"]], ...]
    """Per person: rotations that take the true body orientation to what the estimator said, before and after the
    cut."""


HUBER = 1.5
"""In sigmas: beyond it an image residual counts linearly."""


class _Problem:
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
        self, person: PersonAtCut, state: "_PersonState", camera: "_CameraState"
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

    def cost(self, states: list["_PersonState"], camera: "_CameraState") -> float:
        """½ Σ ρ(residual²), with Huber on the image points."""
        total = 0.0
        for person, state in zip(self.people, states, strict=True):
            for side, view in enumerate((person.before, person.after)):
                image, point = self._side_residuals(view, side, state, camera)
                size = np.linalg.norm(image, axis=-1)
                huber = np.where(size <= HUBER, size**2, 2 * HUBER * size - HUBER**2)
                total += float(huber.sum() + (point**2).sum())
            total += float((self._bone_residuals(person, state) ** 2).sum())
            total += float((self._prior(state)[0] ** 2).sum())
        return 0.5 * (total + float((camera.velocity**2).sum()) / self.settings.camera_velocity_ms**2)

    def image_residual(self, states: list["_PersonState"], camera: "_CameraState") -> float:
        """Weighted median length of the image residuals, in sigmas of one frame."""
        sizes = []
        for person, state in zip(self.people, states, strict=True):
            for side, view in enumerate((person.before, person.after)):
                image, _ = self._side_residuals(view, side, state, camera)
                seen = view.weight > 0.2
                root_n = np.sqrt(len(view.time_s))
                sizes.append(np.linalg.norm(image, axis=-1)[seen] * root_n / np.sqrt(view.weight[seen]))
        values = np.concatenate(sizes)
        return float(np.median(values)) if len(values) else float("nan")

    def _moving(self, state: "_PersonState", time_s: Float[Array, "n"]) -> Float[Array, "n J 3"]:
        basis = np.stack([np.ones_like(time_s), time_s, 0.5 * time_s**2], axis=-1)
        return np.asarray(np.einsum("nk,jkc->njc", basis, state.motion))

    def _camera_points(
        self, view: SideView, side: int, state: "_PersonState", camera: "_CameraState"
    ) -> tuple[Float[Array, "n J 3"], Float[Array, "n J 3"]]:
        """Points in the side's camera, and the same without the translation (for the Jacobian)."""
        X = self._moving(state, view.time_s)
        if side == 0:
            return X, X
        turned = (X + camera.velocity * view.time_s[:, None, None]) @ camera.R_before_after
        return turned + camera.shift, turned

    def _scales(self, view: SideView) -> tuple[Float[Array, "n J 1"], Float[Array, "n J 1"]]:
        # Errors of neighbouring frames are nearly the same error: n frames together weigh like one.
        root = np.sqrt(view.weight / len(view.time_s))[..., None]
        return root / view.sigma_ray, np.sqrt(0.25 + 0.75 * view.weight)[..., None] / (
            self.settings.point_m * np.sqrt(len(view.time_s))
        )

    def _side_residuals(
        self, view: SideView, side: int, state: "_PersonState", camera: "_CameraState"
    ) -> tuple[Float[Array, "n J 2"], Float[Array, "n J 3"]]:
        Y, turned = self._camera_points(view, side, state, camera)
        ray_scale, point_scale = self._scales(view)
        image = (Y[..., :2] / np.maximum(Y[..., 2:], 0.1) - view.rays) * ray_scale
        a, b = self.body.hips
        relative = turned - 0.5 * (turned[:, a : a + 1] + turned[:, b : b + 1])
        return image, (relative @ state.correction[side].T - view.points) * point_scale

    def _side(
        self, view: SideView, side: int, state: "_PersonState", camera: "_CameraState"
    ) -> tuple[list[Array], list[Array]]:
        n, num = view.weight.shape
        Y, turned = self._camera_points(view, side, state, camera)
        ray_scale, point_scale = self._scales(view)
        image, point = self._side_residuals(view, side, state, camera)
        robust = np.sqrt(np.minimum(1.0, HUBER / np.maximum(np.linalg.norm(image, axis=-1, keepdims=True), 1e-9)))
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
        relative = turned - 0.5 * (turned[:, a : a + 1] + turned[:, b : b + 1])
        turn = slice(9 * num + 3 * side, 9 * num + 3 * side + 3)
        J_point[..., turn] = -skew(relative @ C.T) * point_scale[..., None]
        if side == 1:
            J_image[..., shared : shared + 3] = projection @ skew(turned)
            J_image[..., shared + 3 : shared + 6] = projection
            J_image[..., shared + 6 : shared + 9] = d_image * view.time_s[:, None, None, None]
            J_point[..., shared : shared + 3] = C @ skew(relative) * point_scale[..., None]
        return [image.ravel(), point.ravel()], [
            J_image.reshape(-1, self.num_unknowns),
            J_point.reshape(-1, self.num_unknowns),
        ]

    def _bone_times(self, person: PersonAtCut) -> Float[Array, "3"]:
        return np.array([person.before.time_s[0], 0.0, person.after.time_s[-1]])

    def _bone_residuals(self, person: PersonAtCut, state: "_PersonState") -> Float[Array, "3 B"]:
        X = self._moving(state, self._bone_times(person))
        length = np.linalg.norm(X[:, self.bone_a] - X[:, self.bone_b], axis=-1)
        return np.asarray((length - person.bone_lengths) / self.settings.bone_m)

    def _bones(
        self, person: PersonAtCut, state: "_PersonState"
    ) -> tuple[Float[Array, "m"], Float[Array, "m unknowns"]]:
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

    def _prior(self, state: "_PersonState") -> tuple[Float[Array, "m"], Float[Array, "m unknowns"]]:
        """Moderate velocities, accelerations and corrections."""
        settings = self.settings
        weight = np.zeros((self.num_points, 3, 3))
        weight[:, 1], weight[:, 2] = 1 / settings.velocity_ms, 1 / settings.acceleration_ms2
        turn = np.full(6, np.sqrt(3) / np.deg2rad(settings.orientation_deg))
        weights = np.concatenate([weight.ravel(), turn])
        values = np.concatenate([state.motion.ravel(), vector_from_rotation(state.correction).ravel()])
        used = np.flatnonzero(weights)
        J = np.zeros((len(used), self.num_unknowns))
        J[np.arange(len(used)), used] = weights[used]
        return weights[used] * values[used], J

    def normal(
        self, states: list["_PersonState"], camera: "_CameraState"
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


CAMERA_UNKNOWNS = 9
"""Rotation, shift and velocity of the camera after the cut."""


def _damped_step(
    parts: list[tuple[Float[Array, "unknowns"], Float[Array, "unknowns unknowns"]]], damping: float
) -> tuple[list[Float[Array, "own"]], Float[Array, "9"]]:
    """Levenberg-Marquardt step of every person and of the camera; people are eliminated one by one (Schur
    complement)."""
    n = CAMERA_UNKNOWNS
    reduced = np.sum([hessian[-n:, -n:] for _, hessian in parts], axis=0)
    reduced += damping * np.diag(np.diagonal(reduced) + 1e-6)
    right = np.sum([gradient[-n:] for gradient, _ in parts], axis=0)
    solved = []
    for gradient, hessian in parts:
        own, mixed = hessian[:-n, :-n], hessian[:-n, -n:]
        own = own + damping * np.diag(np.diagonal(own) + 1e-6)
        answer = np.linalg.solve(own, np.concatenate([mixed, gradient[:-n, None]], axis=1))
        reduced = reduced - mixed.T @ answer[:, :n]
        right = right - mixed.T @ answer[:, n]
        solved.append(answer)
    camera = -np.linalg.solve(reduced, right)
    return [-(answer[:, n] + answer[:, :n] @ camera) for answer in solved], camera


@dataclass(frozen=True)
class _PersonState:
    motion: Float[Array, "J 3 3"]
    """Position, velocity and acceleration of each point at the cut, in the axes of the camera before it."""
    correction: Float[Array, "2 3 3"]

    def moved(self, step: Float[Array, "unknowns"]) -> "_PersonState":
        num = len(self.motion)
        turns = rotation_from_vector(step[9 * num :].reshape(2, 3))
        return _PersonState(self.motion + step[: 9 * num].reshape(num, 3, 3), turns @ self.correction)


@dataclass(frozen=True)
class _CameraState:
    R_before_after: Float[Array, "3 3"]
    shift: Float[Array, "3"]
    """x_after = R_before_afterᵀ x_before + shift."""
    velocity: Float[Array, "3"]

    def moved(self, step: Float[Array, "9"]) -> "_CameraState":
        return _CameraState(
            self.R_before_after @ rotation_from_vector(step[:3]), self.shift + step[3:6], self.velocity + step[6:9]
        )


def _quadratic(time_s: Float[Array, "n"], values: Float[Array, "n J 3"], damping: float) -> Float[Array, "J 3 3"]:
    basis = np.stack([np.ones_like(time_s), time_s, 0.5 * time_s**2], axis=-1)
    normal = basis.T @ basis + np.diag([0.0, 1e-2 * damping, 1e-4 * damping])
    return (
        np.linalg.solve(normal, np.einsum("nk,njc->kjc", basis, values).reshape(3, -1))
        .reshape(3, *values.shape[1:])
        .transpose(1, 0, 2)
    )


def _start(person: PersonAtCut, R_before_after: Float[Array, "3 3"]) -> tuple[_PersonState, Float[Array, "3"]]:
    """Motion through both sides' 3D points once the second is turned into the first's axes, and the camera's shift."""
    before, after = person.before, person.after
    hip_before = _quadratic(before.time_s, before.origin[:, None], 10.0)[0]
    hip_after = _quadratic(after.time_s, after.origin[:, None], 10.0)[0]
    origin_before = hip_before[0]
    # Velocity carried on: mean of both sides' at the cut.
    velocity = 0.5 * (hip_before[1] + R_before_after @ hip_after[1])
    time_s = np.concatenate([before.time_s, after.time_s])
    points = np.concatenate([before.points, after.points @ R_before_after.T])
    motion = _quadratic(time_s, points, 1.0)
    motion[:, 0] += origin_before
    motion[:, 1] += velocity
    shift = hip_after[0] - R_before_after.T @ origin_before
    return _PersonState(motion, np.stack([np.eye(3), np.eye(3)])), shift


def adjust(
    people: list[PersonAtCut],
    body: BodyPoints,
    R_starts: Float[Array, "s 3 3"],
    settings: BundleSettings,
    screening_iterations: int = 6,
) -> list[BundleResult]:
    """Bundle adjustments from several starts, cheapest first; only the two best after screening are run to the end."""
    problem = _Problem(people, body, settings)
    runs = []
    for R in R_starts:
        starts = [_start(person, R) for person in people]
        camera = _CameraState(R, np.mean([shift for _, shift in starts], axis=0), np.zeros(3))
        runs.append(_minimise(problem, [state for state, _ in starts], camera, screening_iterations))
    runs.sort(key=lambda run: run[2])
    finished = [_minimise(problem, states, camera, settings.max_iterations) for states, camera, _ in runs[:2]]
    runs = sorted([*finished, *runs[2:]], key=lambda run: run[2])
    return [
        BundleResult(
            R_before_after=camera.R_before_after,
            t_before_after=-camera.R_before_after @ camera.shift,
            cost=cost,
            residual_px_ratio=problem.image_residual(states, camera),
            corrections=tuple((state.correction[0], state.correction[1]) for state in states),
        )
        for states, camera, cost in runs
    ]


def _minimise(
    problem: _Problem, states: list[_PersonState], camera: _CameraState, max_iterations: int
) -> tuple[list[_PersonState], _CameraState, float]:
    """Levenberg-Marquardt from one start."""
    damping, cost = 1e-3, problem.cost(states, camera)
    for _ in range(max_iterations):
        parts = problem.normal(states, camera)
        improved = False
        for _ in range(6):
            steps, camera_step = _damped_step(parts, damping)
            new_states = [state.moved(step) for state, step in zip(states, steps, strict=True)]
            new_camera = camera.moved(camera_step)
            new_cost = problem.cost(new_states, new_camera)
            if new_cost < cost:
                improved = True
                break
            damping *= 6
        if not improved:
            break
        gain = cost - new_cost
        states, camera, cost, damping = new_states, new_camera, new_cost, max(damping / 4, 1e-9)
        if gain < 1e-4 * cost:
            break
    return states, camera, cost
