"""Small bundle adjustment through a cut: the people's motion runs on, only the camera changes (paper 3.3.1,
assumption 1).

Unknown are the quadratic motion of each body point through the cut, the rotation and translation between the two
cameras, and one orientation correction of the pose estimator for each person and side: its landmarks are off by a
slowly varying rotation of several degrees, which averaging over frames cannot remove but the other view can.
`residuals` has the measurements. Levenberg-Marquardt with analytic derivatives, people eliminated by the Schur
complement (Triggs et al. 2000, "Bundle adjustment: a modern synthesis", section 6.1); the caller gives the starts,
which all run side by side.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.linalg import cho_factor, cho_solve

from humanmm.models.cuts.residuals import (
    CAMERA_UNKNOWNS,
    BodyPoints,
    BundleSettings,
    CameraState,
    CutProblem,
    PersonAtCut,
    PersonEquations,
    PersonState,
    basis_at,
)

Array = np.ndarray


@dataclass(frozen=True)
class BundleResult:
    """Rotation of the camera at the cut, and how well it fits."""

    R_before_after: Float[Array, "3 3"]
    cost: float
    residual_px_ratio: float
    """Robust mean of the image residuals, in units of sigma_ray."""


@dataclass(frozen=True)
class _Runs:
    """The unknowns of S runs, each from a start of its own."""

    people: list[PersonState]
    camera: CameraState

    def __getitem__(self, chosen: Int[Array, " s"]) -> "_Runs":
        people = [PersonState(one.motion[chosen], one.correction[chosen]) for one in self.people]
        camera = self.camera
        return _Runs(people, CameraState(camera.R_before_after[chosen], camera.shift[chosen], camera.velocity[chosen]))

    def put(self, chosen: Int[Array, " s"], runs: "_Runs") -> None:
        """Overwrite some runs."""
        for own, new in zip(self._arrays(), runs._arrays(), strict=True):
            own[chosen] = new

    def _arrays(self) -> list[Array]:
        of_people = [array for one in self.people for array in (one.motion, one.correction)]
        return [self.camera.R_before_after, self.camera.shift, self.camera.velocity, *of_people]


def _damped_step(
    parts: list[PersonEquations], damping: Float[Array, " S"]
) -> tuple[list[Float[Array, "S own"]], Float[Array, "S 9"]]:
    """Levenberg-Marquardt step of every person and of the camera; the motions are eliminated (Schur complement)."""
    runs, num = len(damping), 6 * len(parts)
    reduced = np.zeros((runs, num + CAMERA_UNKNOWNS, num + CAMERA_UNKNOWNS + 1))
    own = [np.concatenate([np.arange(6 * k, 6 * k + 6), np.arange(num, reduced.shape[2])]) for k in range(len(parts))]
    solved = []
    for part, rows in zip(parts, own, strict=True):
        reduced[:, rows[:-1, None], rows] += part.others[:, :-1]
    _damp(reduced, damping)
    for part, rows in zip(parts, own, strict=True):
        answer = np.empty_like(part.mixed)
        for run in range(runs):  # a matrix at a time stays in the processor's cache
            motion = part.motion.matrix(run)
            _damp(motion[None], damping[[run]])
            answer[run] = cho_solve(cho_factor(motion, overwrite_a=True), part.mixed[run])
        reduced[:, rows[:-1, None], rows] -= np.swapaxes(part.mixed[..., :-1], -1, -2) @ answer
        solved.append(answer)
    others = -np.linalg.solve(reduced[..., :-1], reduced[..., -1:])
    steps = [
        np.concatenate([-(answer[..., -1:] + answer[..., :-1] @ others[:, rows[:-1]]), others[:, rows[:6]]], axis=1)
        for answer, rows in zip(solved, own, strict=True)
    ]
    return [step[..., 0] for step in steps], others[:, num:, 0]


def _damp(hessian: Float[Array, "S k m"], damping: Float[Array, " S"]) -> None:
    """Enlarge each diagonal element by the fraction `damping`."""
    each = np.arange(hessian.shape[1])
    hessian[:, each, each] += damping[:, None] * (hessian[:, each, each] + 1e-6)


def _quadratic(time_s: Float[Array, "n"], values: Float[Array, "n J 3"], damping: float) -> Float[Array, "3 J 3"]:
    """Position, velocity and acceleration at the cut of the parabolas through the values."""
    basis = basis_at(time_s)
    normal = basis.T @ basis + np.diag([0.0, 1e-2 * damping, 1e-4 * damping])
    return np.linalg.solve(normal, basis.T @ values.reshape(len(values), -1)).reshape(3, *values.shape[1:])


def _start(person: PersonAtCut, R_before_after: Float[Array, "3 3"]) -> tuple[Float[Array, "3 J 3"], Float[Array, "3"]]:
    """Motion through both sides' 3D points once the second is rotated into the first's axes, and the camera's shift."""
    before, after = person.before, person.after
    hip_before = _quadratic(before.time_s, before.origin[:, None], 10.0)[:, 0]
    hip_after = _quadratic(after.time_s, after.origin[:, None], 10.0)[:, 0]
    time_s = np.concatenate([before.time_s, after.time_s])
    points = np.concatenate([before.points, after.points @ R_before_after.T])
    motion = _quadratic(time_s, points, 1.0)
    motion[0] += hip_before[0]
    # Velocity carried on: mean of both sides' at the cut.
    motion[1] += 0.5 * (hip_before[1] + R_before_after @ hip_after[1])
    return motion, hip_after[0] - R_before_after.T @ hip_before[0]


def starts_of(people: list[PersonAtCut], R_starts: Float[Array, "S 3 3"]) -> _Runs:
    """A run for each rotation of the camera."""
    states, shifts = [], []
    for person in people:
        motion, shift = (np.stack(column) for column in zip(*(_start(person, R) for R in R_starts), strict=True))
        states.append(PersonState(motion, np.tile(np.eye(3), (len(R_starts), 2, 1, 1))))
        shifts.append(shift)
    return _Runs(states, CameraState(R_starts.copy(), np.mean(shifts, axis=0), np.zeros((len(R_starts), 3))))


def adjust(
    people: list[PersonAtCut], body: BodyPoints, R_starts: Float[Array, "S 3 3"], settings: BundleSettings
) -> list[BundleResult]:
    """Bundle adjustments from several starts, cheapest first; only the two best after screening are run to the end."""
    problem = CutProblem(people, body, settings)
    runs = starts_of(people, R_starts)
    cost = _minimise(problem, runs, SCREENING)
    best = np.argsort(cost, kind="stable")[:2]
    finished = runs[best]
    cost[best] = _minimise(problem, finished, settings.max_iterations)
    runs.put(best, finished)
    residual = problem.image_residual(runs.people, runs.camera)
    return [
        BundleResult(runs.camera.R_before_after[k], float(cost[k]), float(residual[k]))
        for k in np.argsort(cost, kind="stable")
    ]


SCREENING = 4
"""Iterations after which runs are compared: on 27 development clips 6 are no better."""
FIRST_DAMPING, RAISE_BY, LOWER_BY, LEAST_DAMPING = 1e-3, 6.0, 4.0, 1e-9
RELATIVE_DECREASE = 1e-3
"""A step that lowers the cost by less than this fraction of it is the last one of its run."""


def _minimise(problem: CutProblem, runs: _Runs, iterations: int) -> Float[Array, " S"]:
    """Improve all runs side by side by Levenberg-Marquardt steps, one an iteration; returns their costs."""
    cost = problem.cost(runs.people, runs.camera)
    damping = np.full(len(cost), FIRST_DAMPING)
    going = np.arange(len(cost))
    for _ in range(iterations):
        at = runs[going]
        steps, camera_step = _damped_step(problem.equations(at.people, at.camera), damping[going])
        moved = _Runs(
            [person.moved(step) for person, step in zip(at.people, steps, strict=True)], at.camera.moved(camera_step)
        )
        lowered = problem.cost(moved.people, moved.camera)
        decrease = cost[going] - lowered
        better = decrease > 0
        runs.put(going[better], moved[np.flatnonzero(better)])
        cost[going[better]] = lowered[better]
        damping[going] = np.where(
            better, np.maximum(damping[going] / LOWER_BY, LEAST_DAMPING), damping[going] * RAISE_BY
        )
        going = going[~better | (decrease > RELATIVE_DECREASE * lowered)]
        if not len(going):
            break
    return cost
