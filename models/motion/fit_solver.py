"""Levenberg-Marquardt over windows of frames: block-banded normal equations, bounded memory, no seams.

Frames meet only through terms between neighbours, so the normal equations of a window are a band of 2·63 + 1 diagonals
and a step costs the same for every frame. A long motion is solved in windows: each window starts from the last frames
of the one before, which are final and held still, and looks some frames past those it will settle.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.linalg import LinAlgError, solveh_banded

from humanmm.models.motion.fit_state import NUM_PARAMETERS, Motion
from humanmm.models.motion.fit_terms import NormalEquations, Term

Array = np.ndarray

_BAND = 2 * NUM_PARAMETERS + 1
_LOWER = np.tril_indices(NUM_PARAMETERS)
_ALL = np.indices((NUM_PARAMETERS, NUM_PARAMETERS)).reshape(2, -1)


@dataclass(frozen=True)
class SolverSettings:
    """When a window is done, and how long a motion is cut into windows."""

    max_iterations: int = 12
    relative_decrease: float = 1e-3
    """A step that lowers the cost by less than this share is the last one."""
    first_damping: float = 1e-3
    window: int = 120
    """Frames that a window settles."""
    lookahead: int = 24
    """Frames past those, solved along and thrown away, so that what is settled knows what comes."""


def solve_windows(
    motion: Motion,
    terms_of: Callable[[slice], Sequence[Term]],
    settings: SolverSettings | None = None,
) -> Motion:
    """The motion that minimises the terms, started from `motion`; `terms_of(frames)` builds the terms of one window.

    The result has no seams: accelerations across the border of two windows are part of the later one.
    """
    settings = settings or SolverSettings()
    R_root, pelvis, R_body = motion.R_ref_root.copy(), motion.pelvis_ref.copy(), motion.R_body.copy()
    settled = 0
    while settled < motion.num_frames:
        first = max(settled - 2, 0)
        last = min(settled + settings.window, motion.num_frames)
        if motion.num_frames - last < settings.lookahead:
            last = motion.num_frames
        frames = slice(first, min(last + settings.lookahead, motion.num_frames))
        start = Motion(motion.skeleton, R_root[frames], pelvis[frames], R_body[frames])
        held = np.arange(frames.start, frames.stop) < settled
        solved = minimise(start, terms_of(frames), held=held, settings=settings)
        R_root[frames], pelvis[frames], R_body[frames] = solved.R_ref_root, solved.pelvis_ref, solved.R_body
        settled = last
    return Motion(motion.skeleton, R_root, pelvis, R_body)


def minimise(motion: Motion, terms: Sequence[Term], *, held: Bool[Array, " N"], settings: SolverSettings) -> Motion:
    """Levenberg-Marquardt on one window; frames that are `held` do not move."""
    cost = sum(term.cost(motion) for term in terms)
    damping = settings.first_damping
    for _ in range(settings.max_iterations):
        equations = NormalEquations.zeros(motion.num_frames)
        for term in terms:
            term.add(motion, equations)
        _hold(equations, held)
        for _attempt in range(8):
            step = _solve(equations, damping)
            if step is not None:
                candidate = motion.moved(step)
                candidate_cost = sum(term.cost(candidate) for term in terms)
                if candidate_cost < cost:
                    break
            damping = max(damping * 8, 1e-6)
        else:
            return motion
        decrease = cost - candidate_cost
        motion, cost, damping = candidate, candidate_cost, damping / 4
        if decrease < settings.relative_decrease * cost:
            break
    return motion


def _hold(equations: NormalEquations, held: Bool[Array, " N"]) -> None:
    """Take held frames out of the unknowns: their step is zero."""
    if not held.any():
        return
    equations.gradient[held] = 0
    equations.own[held] = np.eye(NUM_PARAMETERS)
    later_one, later_two = np.zeros_like(held), np.zeros_like(held)
    later_one[:-1], later_two[:-2] = held[1:], held[2:]
    equations.next_one[held | later_one] = 0
    equations.next_two[held | later_two] = 0


def _solve(equations: NormalEquations, damping: float) -> Float[Array, "N 63"] | None:
    """The damped step, or None where rounding has made the equations indefinite."""
    num_frames = len(equations.gradient)
    band = np.zeros((_BAND, num_frames, NUM_PARAMETERS))  # band[i − j, j] = H[i, j]
    row, column = _LOWER
    band[row - column, :, column] = equations.own[:, row, column].T
    band[0] *= 1 + damping
    above, below = _ALL
    # next_one is a block above the diagonal; its mirror picture below it has row (t + 1, below) and column (t, above).
    band[NUM_PARAMETERS + below - above, :-1, above] = equations.next_one[:-1, above, below].T
    band[2 * NUM_PARAMETERS, :-2] = equations.next_two[:-2]
    try:
        solution = solveh_banded(
            band.reshape(_BAND, -1), -equations.gradient.ravel(), overwrite_ab=True, lower=True, check_finite=False
        )
    except LinAlgError:
        return None
    step = np.asarray(solution).reshape(num_frames, NUM_PARAMETERS)
    return step if np.isfinite(step).all() else None
