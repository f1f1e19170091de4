"""Levenberg-Marquardt over windows of frames: block-banded normal equations, bounded memory, no seams.

Frames meet only through terms between neighbours, so the normal equations of a window are a band of 2·63 + 1 diagonals
and a step costs the same for every frame. A long motion is solved in windows: each window starts from the last frames
of the one before, which are final and held still, and looks some frames past those it will settle.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool

from humanmm.models.motion.fit.equations import NormalEquations, Term
from humanmm.models.motion.fit.state import LongMotion, Motion

Array = np.ndarray


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
    motion: LongMotion,
    terms_of: Callable[[slice], Sequence[Term]],
    settings: SolverSettings | None = None,
) -> LongMotion:
    """The motion that minimises the terms, started from `motion`; `terms_of(frames)` builds the terms of one window.

    The result has no seams: accelerations across the border of two windows are part of the later one.
    """
    settings = settings or SolverSettings()
    result = LongMotion(motion.skeleton, motion.vectors.copy(), motion.pelvis_ref.copy())
    settled = 0
    while settled < motion.num_frames:
        first = max(settled - 2, 0)
        last = min(settled + settings.window, motion.num_frames)
        if motion.num_frames - last < settings.lookahead:
            last = motion.num_frames
        frames = slice(first, min(last + settings.lookahead, motion.num_frames))
        held = np.arange(frames.start, frames.stop) < settled
        result.put(frames, minimise(result.frames(frames), terms_of(frames), held=held, settings=settings))
        settled = last
    return result


def minimise(motion: Motion, terms: Sequence[Term], *, held: Bool[Array, " N"], settings: SolverSettings) -> Motion:
    """Levenberg-Marquardt on one window; frames that are `held` do not move."""
    cost = sum(term.cost(motion) for term in terms)
    damping = settings.first_damping
    equations = NormalEquations(motion.num_frames)
    for _ in range(settings.max_iterations):
        equations.clear()
        for term in terms:
            term.add(motion, equations)
        equations.hold(held)
        for _attempt in range(8):
            step = equations.step(damping)
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
