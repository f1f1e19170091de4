"""Colour-based shot changes of a whole video in one streaming pass (paper section 3.1, part 1).

Cuts are proposed by the rules of PySceneDetect's adaptive and content detectors (as the paper proposes them, with
thresholds low enough for dark and similar scenes and without their minimum scene length, which hides quick cuts) and
verified by `hard_cuts`; `jump_cuts` finds those of a camera that stays where it is; dissolves and fades come from
`gradual`.
"""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from humanmm.corrections import NONE, Corrections
from humanmm.models.geometry.intervals import Interval, merged
from humanmm.models.records.shots import BRIGHT, Box, Change, Scenes, Transition
from humanmm.models.shot_detection.burned_in import burned_into
from humanmm.models.shot_detection.corrected_cuts import corrected_scenes
from humanmm.models.shot_detection.gradual import (
    DISSOLVE_S,
    dips,
    dissolves,
    fade_around,
    meeting_blends,
    most_frames,
    uniform_runs,
)
from humanmm.models.shot_detection.hard_cuts import REACH, hard_cuts
from humanmm.models.shot_detection.jump_cuts import Jump, changes, jumps
from humanmm.models.shot_detection.picture_window import SIDE_PX, PictureWindow
from humanmm.models.video.frame_times import elapsed_s, sampled_every
from humanmm.models.video.frames import frames
from humanmm.models.video.light import brightened, gain_of
from humanmm.models.video.opened import Video
from humanmm.models.video.prefetch import prefetched
from humanmm.models.video.progress import Progress, silent

_CONTENT_THRESHOLD = 20.0
"""PySceneDetect's default is 27; proposals are verified, so that a lower one costs only time."""
_ADAPTIVE_MIN_CONTENT = 3.0
"""PySceneDetect's default is 15, which misses cuts between dark pictures; with 6 one of a night still was."""
_ADAPTIVE_RATIO, _ADAPTIVE_WINDOW = 3.0, 2
"""A change so many times as large as the mean of so many on either side is one that stands out (its defaults)."""
_BLOCK = 256
"""Frames that are decided at once."""
_SAMPLE_S, _MOST_SAMPLES = 0.25, 1200
"""Time between the pictures that are compared for what is burned in, and how many are kept at most."""
_FLICKER_S = 0.25
"""Uniform pictures for a shorter time between two views of one place are a flash or a flicker, not a fade."""


class SceneDetector:
    """Takes small pictures one at a time, then gives the scenes.

    `time_s` holds the presentation times of all frames of the video.
    """

    def __init__(self, time_s: np.ndarray) -> None:
        self._window = PictureWindow(time_s)
        self._longest = most_frames(time_s, DISSOLVE_S)
        self._margin = max(REACH, self._longest) + 8
        self._proposals: list[int] = []
        self._cuts: list[int] = []
        self._jumps: dict[int, Jump] = {}
        self._changes: list[Change] = []
        self._dissolves: list[Interval] = []
        self._flickers: list[Interval] = []
        self._dips: list[Interval] = []
        self._decided = 0
        self._shape = (0, 0)
        self._sampled = sampled_every(time_s, max(_SAMPLE_S, float(time_s[-1] - time_s[0]) / _MOST_SAMPLES))
        self.samples: dict[int, np.ndarray] = {}
        """Some of the pictures, (h,w) uint8 each, by frame."""

    def add(self, bgr: np.ndarray) -> None:
        """The next frame, (h,w,3) uint8, largest side `SIDE_PX`."""
        self._window.append(bgr)
        self._shape = bgr.shape[:2]
        if self._sampled[self._window.end - 1]:
            self.samples[self._window.end - 1] = self._window.gray[-1]
        self._proposals += proposals(self._window.change)
        if self._window.end - self._decided >= _BLOCK + self._margin:
            self._decide(self._decided + _BLOCK)

    def finish(self) -> Scenes:
        """All transitions, in order, without overlap."""
        if self._window.end > self._decided:
            self._decide(self._window.end)
        contrast, time_s = self._window.contrast, self._window.time_s
        fades = [
            fade_around(contrast, run, time_s)
            for run in uniform_runs(self._window.uniform)
            if run not in self._flickers
        ]
        blends, dim = meeting_blends(contrast, self._dissolves)
        # fades that touch are one: black, a flicker of grey, black
        transitions = _without_overlap(
            self._cuts, blends, [self._fade(whole) for whole in merged([*fades, *self._dips, *dim])]
        )
        suspected = tuple(
            jump.frame
            for jump in self._jumps.values()
            if not jump.certain and not any(t.start <= jump.frame <= t.end for t in transitions)
        )
        inside = (one for one in self._changes if not any(t.start <= one.frame <= t.end for t in transitions))
        return Scenes(self._window.end, transitions, suspected=suspected, changes=tuple(inside))

    def filmed(self, width_px: int) -> Scenes:
        """The same with what is drawn over every scene, and how far places move, in pixels of the video (`width_px`
        wide), and without the jump cuts, and suspected ones, that are seen there alone."""
        scenes = self.finish()
        drawn = burned_into(self.samples, scenes, width_px)
        within = self._jumps_in(itertools.chain(*drawn), width_px)
        kept = tuple(one for one in scenes.transitions if one.start < one.end or one.start not in within)
        if len(kept) < len(scenes.transitions):
            drawn = burned_into(self.samples, replace(scenes, transitions=kept), width_px)
        suspected = tuple(frame for frame in scenes.suspected if frame not in within)
        scale = width_px / self._shape[1]
        in_video = tuple(replace(one, step=(one.step[0] * scale, one.step[1] * scale)) for one in scenes.changes)
        return replace(scenes, transitions=kept, suspected=suspected, changes=in_video, burned_in=drawn)

    def _jumps_in(self, boxes: Iterable[Box], width_px: int) -> set[int]:
        """The jump cuts that are seen in these boxes alone."""
        if not self._jumps:
            return set()
        part = np.zeros(self._shape, bool)
        for box in boxes:
            x0, y0, x1, y1 = (round(value * part.shape[1] / width_px) for value in box)
            part[y0:y1, x0:x1] = True
        return {frame for frame, jump in self._jumps.items() if jump.is_within(part)}

    def _decide(self, until: int) -> None:
        """Settle everything in [decided, until); needs the pictures of `margin` frames on both sides."""
        window, begin = self._window, self._decided
        found = dissolves(window, begin, until, self._longest)
        self._dissolves += found
        here = sorted({p for p in self._proposals if begin <= p < until and p > 0})
        self._proposals = [p for p in self._proposals if p >= until]
        shots = [*self._cuts, *(s.end for s in self._dissolves if s.end <= begin)]
        self._cuts += hard_cuts(window, here, max(shots, default=0))
        found_jumps = list(jumps(window, begin, until, set(self._cuts)))
        self._jumps |= {jump.frame: jump for jump in found_jumps}
        self._cuts += [jump.frame for jump in found_jumps if jump.certain]
        self._changes += changes(window, begin, until, set(self._cuts))
        for run in uniform_runs(window.uniform):
            is_short = elapsed_s(window.time_s, run.start, run.end) <= _FLICKER_S
            if begin <= run.end < until and is_short and self._same_place(run):
                self._flickers.append(run)
        first = window.first
        for dip in dips(window.contrast[first:], window.time_s[first : window.end]):
            fade = Interval(first + dip.start, first + dip.end)
            is_here = begin <= (fade.start + fade.end) // 2 < until
            if is_here and not any(window.uniform[fade.start : fade.end]) and not self._same_place(fade):
                self._dips.append(fade)
        self._decided = until
        window.forget_before(until - self._margin)

    def _fade(self, whole: Interval) -> Transition:
        """A fade, with the frames between the first and the last that are dim."""
        contrast = np.array(self._window.contrast)
        inside, beside = contrast[whole.start : whole.end], (max(whole.start - 1, 0), min(whole.end, len(contrast) - 1))
        out, into = (inside < BRIGHT * contrast[frame] for frame in beside)
        first, last = (np.flatnonzero(dim) if dim.any() else [inside.argmin()] for dim in (out, into))
        dim = whole.start + int(first[0]), whole.start + int(last[-1]) + 1
        return Transition("fade", whole.start, whole.end, "scene", dim)

    def _same_place(self, run: Interval) -> bool:
        """Whether the pictures around a short uniform run show one place."""
        window = self._window
        around = [(run.start - 1 - k, run.end + k) for k in (0, 2, 4)]
        return any(window.displacement(a, b) is not None for a, b in around if a >= window.first and b < window.end)


def proposals(change: Sequence[float]) -> Iterator[int]:
    """Frames of which the last change (PySceneDetect's content value, by frame) shows that a cut may lie there.

    The content rule proposes the last frame itself, the adaptive rule the one two frames before.
    """
    last = len(change) - 1
    if change[last] >= _CONTENT_THRESHOLD:
        yield last
    middle, first = last - _ADAPTIVE_WINDOW, last - 2 * _ADAPTIVE_WINDOW
    if first >= 0 and change[middle] >= _ADAPTIVE_MIN_CONTENT:
        around = (sum(change[first:]) - change[middle]) / (2 * _ADAPTIVE_WINDOW)
        if change[middle] >= _ADAPTIVE_RATIO * around:
            yield middle


def detect_scenes(video: Video, *, corrections: Corrections = NONE, progress: Progress = silent) -> Scenes:
    """Scenes of the whole video by colour, from pictures of SIDE_PX, with the cuts that the user adds and without
    those that he removes; and what is burned into them."""
    facts = video.facts
    detector = SceneDetector(facts.time_s)
    gain = gain_of(facts, 0, facts.num_frames, shown=1.0)
    with prefetched(frames(video.stream, facts, pixels="bgr", max_side_px=SIDE_PX)) as decoded:
        for frame in decoded:
            detector.add(brightened(frame.image, gain))
            progress(frame.index + 1, facts.num_frames)
    filmed = detector.filmed(facts.width)
    scenes = corrected_scenes(filmed, corrections)
    same = scenes.transitions == filmed.transitions
    return replace(scenes, burned_in=filmed.burned_in if same else burned_into(detector.samples, scenes, facts.width))


def find_scenes(pictures: Iterable[np.ndarray], time_s: np.ndarray) -> Scenes:
    """Scenes of a video given as small (h,w,3) uint8 BGR pictures in order, and their (F,) presentation times."""
    detector = SceneDetector(time_s)
    for bgr in pictures:
        detector.add(bgr)
    return detector.finish()


def _without_overlap(cuts: list[int], dissolves: list[Interval], fades: list[Transition]) -> tuple[Transition, ...]:
    """One transition for one change: a fade swallows what lies inside it, then a dissolve does."""
    kept = list(fades)
    for span in dissolves:
        if not any(span.start <= t.end and t.start <= span.end for t in kept):
            kept.append(Transition("dissolve", span.start, span.end, "scene"))
    for cut in cuts:
        if not any(t.start <= cut <= t.end for t in kept):
            kept.append(Transition("cut", cut, cut, "scene"))
    return tuple(sorted(kept, key=lambda t: t.start))
