"""Colour-based shot changes of a whole video in one streaming pass (paper section 3.1, part 1).

Cuts are proposed by the rules of PySceneDetect's adaptive and content detectors (as the paper proposes them, with
thresholds low enough for dark and similar scenes and without their minimum scene length, which hides quick cuts) and
verified by `hard_cuts`; dissolves and fades come from `gradual`.
"""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from humanmm.models.records.shots import Scenes, Transition
from humanmm.models.shots.footage import Footage
from humanmm.models.shots.gradual import DISSOLVE_S, Span, dissolves, fade_around, meeting_blends, uniform_runs
from humanmm.models.shots.hard_cuts import REACH, hard_cuts

_CONTENT_THRESHOLD = 20.0
"""PySceneDetect's default is 27; proposals are verified, so that a lower one costs only time."""
_ADAPTIVE_MIN_CONTENT = 6.0
"""PySceneDetect's default is 15, which misses cuts between dark pictures."""
_ADAPTIVE_RATIO, _ADAPTIVE_WINDOW = 3.0, 2
"""A change so many times as large as the mean of so many on either side is one that stands out (its defaults)."""
_BLOCK = 256
"""Frames that are decided at once."""
_FLICKER_S = 0.25
"""Uniform pictures for a shorter time between two views of one place are a flash or a blink, not a fade."""


class SceneDetector:
    """Give it small pictures one at a time, then ask for the scenes."""

    def __init__(self, fps: float) -> None:
        self._fps = max(fps, 1.0)
        self._footage = Footage()
        self._longest = round(DISSOLVE_S * self._fps)
        self._margin = max(REACH, self._longest) + 8
        self._proposals: list[int] = []
        self._cuts: list[int] = []
        self._dissolves: list[Span] = []
        self._flickers: list[Span] = []
        self._decided = 0

    def add(self, bgr: np.ndarray) -> None:
        """The next frame, (h,w,3) uint8, largest side `footage.SIDE_PX`."""
        self._footage.append(bgr)
        self._proposals += proposals(self._footage.change)
        if self._footage.end - self._decided >= _BLOCK + self._margin:
            self._decide(self._decided + _BLOCK)

    def finish(self) -> Scenes:
        """All transitions, in order, without overlap."""
        if self._footage.end > self._decided:
            self._decide(self._footage.end)
        contrast = self._footage.contrast
        fades = [fade_around(contrast, run, self._fps) for run in uniform_runs(contrast) if run not in self._flickers]
        blends, dim = meeting_blends(contrast, self._dissolves)
        return Scenes(self._footage.end, _without_overlap(self._cuts, blends, _joined([*fades, *dim])))

    def _decide(self, until: int) -> None:
        """Settle everything in [decided, until); needs the pictures of `margin` frames on both sides."""
        footage, begin = self._footage, self._decided
        found = dissolves(footage, begin, until, self._longest)
        self._dissolves += found
        here = sorted({p for p in self._proposals if begin <= p < until and p > 0})
        self._proposals = [p for p in self._proposals if p >= until]
        changes = [*self._cuts, *(s.end for s in self._dissolves if s.end <= begin)]
        self._cuts += hard_cuts(footage, here, max(changes, default=0))
        for run in uniform_runs(footage.contrast):
            if begin <= run.end < until and run.end - run.start <= _FLICKER_S * self._fps and self._same_place(run):
                self._flickers.append(run)
        self._decided = until
        footage.forget_before(until - self._margin)

    def _same_place(self, run: Span) -> bool:
        """Whether the pictures around a short uniform run show one place."""
        footage = self._footage
        around = [(run.start - 1 - k, run.end + k) for k in (0, 2, 4)]
        return any(footage.displacement(a, b) is not None for a, b in around if a >= footage.first and b < footage.end)


def proposals(change: Sequence[float]) -> Iterator[int]:
    """Frames of which the last change (PySceneDetect's content value, by frame) tells that a cut may lie there.

    The content rule tells it of the last frame itself, the adaptive rule of the one two frames before.
    """
    last = len(change) - 1
    if change[last] >= _CONTENT_THRESHOLD:
        yield last
    middle, first = last - _ADAPTIVE_WINDOW, last - 2 * _ADAPTIVE_WINDOW
    if first >= 0 and change[middle] >= _ADAPTIVE_MIN_CONTENT:
        around = (sum(change[first:]) - change[middle]) / (2 * _ADAPTIVE_WINDOW)
        if change[middle] >= _ADAPTIVE_RATIO * around:
            yield middle


def find_scenes(pictures: Iterable[np.ndarray], fps: float) -> Scenes:
    """Scenes of a video given as small (h,w,3) uint8 BGR pictures in order."""
    detector = SceneDetector(fps)
    for bgr in pictures:
        detector.add(bgr)
    return detector.finish()


def _joined(fades: list[Span]) -> list[Span]:
    """Fades that touch are one: black, a flicker of grey, black."""
    joined: list[Span] = []
    for fade in sorted(fades, key=lambda s: s.start):
        if joined and fade.start <= joined[-1].end:
            joined[-1] = Span(joined[-1].start, max(joined[-1].end, fade.end))
        else:
            joined.append(fade)
    return joined


def _without_overlap(cuts: list[int], dissolves: list[Span], fades: list[Span]) -> tuple[Transition, ...]:
    """One transition for one change: a fade swallows what lies inside it, then a dissolve does."""
    kept = [Transition("fade", s.start, s.end, "scene") for s in fades]
    for span in dissolves:
        if not any(span.start <= t.end and t.start <= span.end for t in kept):
            kept.append(Transition("dissolve", span.start, span.end, "scene"))
    for cut in cuts:
        if not any(t.start <= cut <= t.end for t in kept):
            kept.append(Transition("cut", cut, cut, "scene"))
    return tuple(sorted(kept, key=lambda t: t.start))
