"""Jump cuts: the camera stays where it is, time is left out, and everybody jumps at once.

Colours hardly change at such a cut, and the place is the same, so that the rules of `hard_cuts` see nothing. What shows
it is that the dense motion between two frames cannot carry the one onto the other where somebody moves, in one step
alone. Two numbers stand out there against the frames on both sides: the part of the picture that stays unmatched once
its motion is undone, and the change of the picture itself. Somebody fast leaves much unmatched in every frame. What is
no higher than letters and changes where nothing moves on either side is a subtitle.
"""

import itertools
import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, UInt8

from humanmm.models.records.shots import Change
from humanmm.models.shot_detection.picture_window import PictureWindow
from humanmm.models.shot_detection.similarity import MotionMeter

STANDS_OUT = 2.0
"""Geometric mean of how many times both numbers are as large as the largest on either side. In nine real clips and 52
rendered ones (7,000 frames without a cut) one frame reaches it, at which the sun goes behind somebody."""
SUSPECTED = 1.8
"""The same from which a cut is suspected: one more of those frames reaches it; two reach 1.6."""
AROUND = 5
"""Frames on either side that are compared; FEWEST of them must be known."""
FEWEST = 2
LEAST_UNMATCHED, LEAST_CHANGE = 0.01, 1.0
"""Smaller numbers on both sides are noise: a fraction of the picture, and a content value of PySceneDetect."""
LEAST_JUMP = 0.9
"""Fraction of the change on either side below which a frame is no candidate: saves the motion of most frames."""
OUTSTANDING = 1.05
"""How many times as large as any around it a change must be for what people do at that frame to count: 6 % of the
frames of real clips in which nothing is left out have it, 2 % of rendered ones."""
LONGEST_STALL = 10.0
"""A recorder that stalls repeats a picture for no longer than so many frames; who stands still does for longer."""
SAME_PLACE = 0.35
"""Mean correlation (`Motion.match`) below which the picture shows another place, or damage: `hard_cuts` decides."""
LETTERS = 0.25
"""Of the picture's height: subtitles are lower. Somebody who sits still and gives way to somebody else is higher."""
LIGHT_STEP, LIT = 8.0, 0.25
"""Grey levels, and fraction of the picture's cells: when more of them become darker alone (or brighter), the light has
changed, not the time."""


@dataclass(frozen=True, eq=False)
class Jump:
    """A frame before which time may have been left out."""

    frame: int
    outstanding: float
    """How many times as large as around it both numbers are (geometric mean)."""
    unmatched: float
    """Part of the picture that stays unmatched, 0..1."""
    pictures: tuple[UInt8[np.ndarray, "height width"], UInt8[np.ndarray, "height width"]]
    """The frame before, and this one, small and grey."""

    @property
    def certain(self) -> bool:
        """Whether it is a jump cut."""
        return self.outstanding >= STANDS_OUT

    def is_within(self, drawn: Bool[np.ndarray, "height width"]) -> bool:
        """Whether it is seen in what is drawn over the film alone: a cut of another video that is shown there."""
        outside = MotionMeter()(*self.pictures, ~drawn).unmatched
        return self.outstanding * math.sqrt(min(1.0, outside / self.unmatched)) < SUSPECTED


def jumps(window: PictureWindow, begin: int, until: int, known: Collection[int]) -> Iterator[Jump]:
    """Frames of [begin, until) at which time may have been left out.

    `known`: frames that begin a shot otherwise. The pictures of AROUND frames on both sides must be in the window (as
    far as the video has them).
    """
    for frame in range(max(begin, 1), until):
        if frame not in known and (jump := _jump(window, frame, known)) is not None:
            yield jump


def changes(window: PictureWindow, begin: int, until: int, known: Collection[int]) -> Iterator[Change]:
    """Frames of [begin, until) at which the picture changes more than at any around them, as far as their shot goes.

    `known`: frames that begin a shot. The pictures around must be in the window, as for `jumps`. After a picture that
    is repeated whatever moves has moved on, so that such frames are left out.
    """
    for frame in range(max(begin, 2), min(until, window.end - 1)):
        if frame in known or window.frozen(frame - 1) or (step := _step(window, frame, known)) is None:
            continue
        if step.larger >= OUTSTANDING:
            before, here, after = (np.array(window.motion(t - 1, t).shift) for t in (frame - 1, frame, frame + 1))
            right, down = here - (before + after) / 2
            yield Change(frame, step.larger, (float(right), float(down)))


@dataclass(frozen=True)
class _Step:
    """How a picture changes from one frame to the next, and how those around it do."""

    around: tuple[int, ...]
    late: float
    """How many times the usual time has gone by."""
    larger: float
    """How many times as large the change is as the largest around it, in the same time."""


def _step(window: PictureWindow, frame: int, known: Collection[int]) -> _Step | None:
    """None where too few frames around it are known."""
    before = _side(range(frame - 1, max(window.first, frame - 1 - AROUND), -1), known)
    after = _side(range(frame + 1, min(window.end, frame + 1 + AROUND)), known)
    if min(len(before), len(after)) < FEWEST:
        return None
    around = (*before, *after)
    usual_s = float(np.median([window.elapsed_s(t - 1, t) for t in around]))
    repeated_s = min(window.unseen_s(frame), LONGEST_STALL * usual_s)
    late = max(1.0, window.elapsed_s(frame - 1, frame) / usual_s, repeated_s / usual_s)
    larger = window.change[frame] / max(LEAST_CHANGE, late * max(window.change[t] for t in around))
    return _Step(around, late, larger)


def _jump(window: PictureWindow, frame: int, known: Collection[int]) -> Jump | None:
    """None where what stands out is less than SUSPECTED times as large as around it, or where place or light explain
    it."""
    step = _step(window, frame, known)
    if step is None or step.larger < LEAST_JUMP:
        return None
    around, late, larger = step.around, step.late, step.larger
    motion = window.motion(frame - 1, frame)
    if motion.match < SAME_PLACE:
        return None
    usual, enough = LEAST_UNMATCHED, motion.unmatched * larger / SUSPECTED**2
    for t in around:
        if usual > enough:  # most frames need the motion of few others
            return None
        usual = max(usual, late * window.motion(t - 1, t).unmatched)
    moving = window.moving(around)
    filmed = moving | window.replaced(frame, ~moving, LETTERS)
    unmatched = min(motion.unmatched, window.unmatched(frame, filmed))
    outstanding = math.sqrt(larger * unmatched / usual)
    if outstanding < SUSPECTED or _light_changes(window, frame):
        return None
    return Jump(frame, outstanding, unmatched, window.pair(frame))


def _side(frames: range, known: Collection[int]) -> list[int]:
    """The frames up to the next cut, nearest first."""
    return list(itertools.takewhile(lambda t: t not in known, frames))


def _light_changes(window: PictureWindow, frame: int) -> bool:
    change = window.luma(frame) - window.luma(frame - 1)
    darker, brighter = np.mean(change < -LIGHT_STEP), np.mean(change > LIGHT_STEP)
    return bool(max(darker, brighter) > LIT and min(darker, brighter) < LIT / 5)
