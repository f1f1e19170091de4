"""Small bundle adjustment through a cut: the people's motion runs on, only the camera changes (paper 3.3.1,
assumption 1).

Unknown are the quadratic motion of each body point through the cut, the rotation and translation between the two
cameras, and one orientation correction of the pose estimator for each person and side: its landmarks are off by a
slowly varying rotation of several degrees, which averaging over frames cannot remove but the other view can.
`residuals` has the measurements. Levenberg-Marquardt with analytic Jacobians, people eliminated by the Schur complement
(Triggs et al. 2000, "Bundle adjustment: a modern synthesis", section 6.1); the caller gives the starts.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from humanmm.models.cuts.residuals import (
    CAMERA_UNKNOWNS,
    BodyPoints,
    BundleSettings,
    CameraState,
    CutProblem,
    PersonAtCut,
    PersonState,
    basis_at,
)
from humanmm.models.geometry.levenberg_marquardt import Schedule, levenberg_marquardt

Array = np.ndarray


@dataclass(frozen=True)
class BundleResult:
    """Rotation of the camera at the cut, and how well it fits."""

    R_before_after: Float[Array, "3 3"]
    cost: float
    residual_px_ratio: float
    """Robust mean of the image residuals, in units of sigma_ray."""


@dataclass(frozen=True)
class _State:
    people: list[PersonState]
    camera: CameraState


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


def _quadratic(time_s: Float[Array, "n"], values: Float[Array, "n J 3"], damping: float) -> Float[Array, "3 J 3"]:
    """Position, velocity and acceleration at the cut of the parabolas through the values."""
    basis = basis_at(time_s)
    normal = basis.T @ basis + np.diag([0.0, 1e-2 * damping, 1e-4 * damping])
    return np.linalg.solve(normal, basis.T @ values.reshape(len(values), -1)).reshape(3, *values.shape[1:])


def _start(person: PersonAtCut, R_before_after: Float[Array, "3 3"]) -> tuple[PersonState, Float[Array, "3"]]:
    """Motion through both sides' 3D points once the second is rotated into the first's axes, and the camera's shift."""
    before, after = person.before, person.after
    hip_before = _quadratic(before.time_s, before.origin[:, None], 10.0)[:, 0]
    hip_after = _quadratic(after.time_s, after.origin[:, None], 10.0)[:, 0]
    origin_before = hip_before[0]
    # Velocity carried on: mean of both sides' at the cut.
    velocity = 0.5 * (hip_before[1] + R_before_after @ hip_after[1])
    time_s = np.concatenate([before.time_s, after.time_s])
    points = np.concatenate([before.points, after.points @ R_before_after.T])
    motion = _quadratic(time_s, points, 1.0)
    motion[0] += origin_before
    motion[1] += velocity
    shift = hip_after[0] - R_before_after.T @ origin_before
    return PersonState(motion, np.stack([np.eye(3), np.eye(3)])), shift


def adjust(
    people: list[PersonAtCut],
    body: BodyPoints,
    R_starts: Float[Array, "s 3 3"],
    settings: BundleSettings,
    screening_iterations: int = 6,
) -> list[BundleResult]:
    """Bundle adjustments from several starts, cheapest first; only the two best after screening are run to the end."""
    problem = CutProblem(people, body, settings)
    runs = []
    for R in R_starts:
        starts = [_start(person, R) for person in people]
        camera = CameraState(R, np.mean([shift for _, shift in starts], axis=0), np.zeros(3))
        runs.append(_minimise(problem, _State([state for state, _ in starts], camera), screening_iterations))
    runs.sort(key=lambda run: run[1])
    finished = [_minimise(problem, state, settings.max_iterations) for state, _ in runs[:2]]
    runs = sorted([*finished, *runs[2:]], key=lambda run: run[1])
    return [
        BundleResult(
            R_before_after=state.camera.R_before_after,
            cost=cost,
            residual_px_ratio=problem.image_residual(state.people, state.camera),
        )
        for state, cost in runs
    ]


def _minimise(problem: CutProblem, start: _State, iterations: int) -> tuple[_State, float]:
    """The unknowns of least cost from one start, and their cost."""

    def linearise(at: _State) -> Callable[[float], _State]:
        parts = problem.normal(at.people, at.camera)

        def stepped(damping: float) -> _State:
            steps, camera_step = _damped_step(parts, damping)
            moved = [person.moved(step) for person, step in zip(at.people, steps, strict=True)]
            return _State(moved, at.camera.moved(camera_step))

        return stepped

    schedule = Schedule(iterations=iterations, trials=6, damping=1e-3, raise_by=6, lower_by=4, least_lowered=1e-9)
    return levenberg_marquardt(
        start, cost=lambda at: problem.cost(at.people, at.camera), linearise=linearise, schedule=schedule
    )
