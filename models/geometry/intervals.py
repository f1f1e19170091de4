"""Half-open intervals [start, end) of frames: which frames lie in them, where a condition holds, what they cover."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Int

Array = np.ndarray


class Interval(NamedTuple):
    """Frames start, …, end − 1."""

    start: int
    end: int


def in_intervals(frame: Int[Array, " n"], intervals: Iterable[tuple[int, int]]) -> Bool[Array, " n"]:
    """Which frame numbers lie in one of the intervals."""
    inside = np.zeros(len(frame), bool)
    for start, end in intervals:
        inside |= (frame >= start) & (frame < end)
    return inside


def runs_of_true(holds: Bool[Array, " n"]) -> list[Interval]:
    """The longest intervals of indices over which a condition holds, in order."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]]).astype(np.int8)))
    return [Interval(start, end) for start, end in edges.reshape(-1, 2).tolist()]


def frame_intervals(frame: Int[Array, " n"], holds: Bool[Array, " n"]) -> tuple[Interval, ...]:
    """`runs_of_true` in frame numbers (increasing, holes allowed): a hole belongs to the run before it."""
    end_of = np.append(frame, frame[-1:] + 1)
    return tuple(Interval(int(end_of[start]), int(end_of[end])) for start, end in runs_of_true(holds))


def merged(intervals: Iterable[tuple[int, int]], *, gap: int = 0) -> list[Interval]:
    """Intervals in order that cover the same frames and the gaps of up to `gap` frames between them."""
    union: list[Interval] = []
    for start, end in sorted(intervals):
        if union and start <= union[-1].end + gap:
            union[-1] = Interval(union[-1].start, max(union[-1].end, end))
        else:
            union.append(Interval(start, end))
    return union
