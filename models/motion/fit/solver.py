"""Levenberg-Marquardt over windows of frames: block-banded normal equations, bounded memory, no discontinuities.

Frames meet only through terms between neighbours, so the normal equations of a window are a band of 2·63 + 1 diagonals
and a step costs the same for every frame. A long motion is solved in windows: each window starts from the last frames
of the one before, which are final and held still, and looks some frames past those it will settle.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.geometry.levenberg_marquardt import Schedule, levenberg_marquardt
from humanmm.models.motion.fit.equations import REFERENCE_HZ, NormalEquations, Term
from humanmm.models.motion.fit.state import LongMotion, Motion
from humanmm.models.video.progress import Progress, silent

Array = np.ndarray

LONGEST = 8.0
"""How many times as many frames a window has at most."""


@dataclass(frozen=True)
class SolverSettings:
    """When a window is done, and how long a motion is cut into windows."""

    max_iterations: int = 12
    relative_decrease: float = 1e-3
    """A step that lowers the cost by less than this fraction is the last one."""
    first_damping: float = 1e-3
    window: int = 120
    """Frames that a window settles, of a video of REFERENCE_HZ or fewer."""
    lookahead: int = 24
    """Frames past those, solved along and thrown away, so that what is settled knows what comes."""

    def lasting(self, time_s: Float[Array, " N"]) -> "SolverSettings":
        """The same with windows that last as long for frames at these times if there are more than REFERENCE_HZ of
        them a second; LONGEST times as many frames at most, which bounds the memory."""
        frame_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 1.0
        times = min(max(1.0, 1 / (REFERENCE_HZ * frame_s)), LONGEST)
        return replace(self, window=round(times * self.window), lookahead=round(times * self.lookahead))


def solve_windows(
    motion: LongMotion,
    terms_of: Callable[[slice], Sequence[Term]],
    settings: SolverSettings | None = None,
    *,
    progress: Progress = silent,
) -> LongMotion:
    """The motion that minimises the terms, started from `motion`; `terms_of(frames)` builds the terms of one window.

    The result has no discontinuities: accelerations across the border of two windows are part of the later one.
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
        progress(settled, motion.num_frames)
    return result


def minimise(motion: Motion, terms: Sequence[Term], *, held: Bool[Array, " N"], settings: SolverSettings) -> Motion:
    """One window's motion of least cost; frames that are `held` do not move."""
    equations = NormalEquations(motion.num_frames)

    def linearise(at: Motion) -> Callable[[float], Motion | None]:
        equations.clear()
        for term in terms:
            term.add(at, equations)
        equations.hold(held)
        return lambda damping: None if (step := equations.step(damping)) is None else at.moved(step)

    schedule = Schedule(
        iterations=settings.max_iterations, trials=8, damping=settings.first_damping, raise_by=8, lower_by=4,
        least_raised=1e-6, relative_decrease=settings.relative_decrease,
    )  # fmt: skip
    found, _ = levenberg_marquardt(
        motion, cost=lambda at: sum(term.cost(at) for term in terms), linearise=linearise, schedule=schedule
    )
    return found
