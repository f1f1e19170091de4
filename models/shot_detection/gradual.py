"""Gradual transitions: a dissolve is a linear blend of two pictures, a fade passes through a uniform one.

Dissolve over [s, e): thumbnail T_t = (1 − a_t) T_before + a_t T_after with a_t rising linearly in time from 0 to 1. A
pan or a walking person makes no such blend: in its middle it shows what neither end shows. A slow flight may: its
thumbnails hardly differ. But a blend of two pictures that have nothing in common has less detail than either (of the
variance, (1 − a)² and a² of theirs; Alattar 1993, "Detecting and compressing dissolve regions in video sequences"), and
a picture on the way from one to the other has as much. A camera that sweeps loses detail as well, but not by this
parabola; nor do two dissolves one after the other, taken for one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from humanmm.models.geometry.intervals import Interval, merged, runs_of_true
from humanmm.models.shot_detection.picture_window import THUMB, PictureWindow
from humanmm.models.video.frame_times import ROUNDING_S

_MIN_LENGTH = 3
"""A blend of fewer frames is a hard cut."""
_MIN_DIFFERENCE = 8.0
"""Root-mean-square difference in grey levels that two ends must have."""
_MAX_RESIDUAL = 0.4
"""Largest part of the ends' difference that a blend may leave unexplained (motion in either scene meanwhile)."""
_WORST_RESIDUAL = 0.5
"""The same for each quarter of a window that may hold a dissolve. In the middle of a pan it is 0.87."""
_MAX_RAMP_ERROR = 0.12
"""Root-mean-square deviation of the blend weight from a straight ramp; motion bends it."""
_MAX_LEAP, _LEAP_TIMES = 0.4, 4.0
"""No single frame of a dissolve makes more than this fraction of the change, or more than so many times the change that
is even for its time: that would be a hard cut."""
_LOST_DETAIL = 0.3
"""Least part of the detail that a blend loses which is lost: 0.39 to 1.3 in dissolves; in spans that look like one and
are none 0.25 at most, but for those in which a camera that sweeps or shakes blurs what both ends show."""
_MAX_DETAIL_ERROR = 0.15
"""Root-mean-square deviation of the detail, as a part of what its ends have, from the parabola of a blend: 0.01 to 0.14
in dissolves (0.03 in the median); 0.19 or more in long sweeps, and where two dissolves half a second apart look like
one."""
_UNRELATED = 0.28
"""The ends of most dissolves correlate less once motion is undone (0.02 to 0.25). Ends that are more alike may be of a
camera that sweeps for some frames, whose blur loses detail too."""
_BLENDED, _CLEAR_FRAMES, _CLEAR_ERROR = 0.6, 8, 0.05
"""Such ends must explain this part of the detail midway (0.71 in three dissolves; 0 to 0.48 in sweeps), or so many
frames go by the parabola with this error at most: three frames of a hand that sweeps do by chance (0.07)."""
_FAIR_STEP = 0.5
"""Each frame of a dissolve makes at least this fraction of the change that is even for its time."""
_RAMP_RANGE = (0.15, 0.85)
"""Fractions of the full contrast between which a fade's ramp is fitted; coding noise bends its ends."""
_DIM = 0.35
"""Two blends that meet in a picture of less than this fraction of the contrast around them are one fade."""
_MEETING = 2
"""Frames that may lie between two blends that belong together."""
_DIP, _DIP_S, _LEAST_RAMP = 0.25, 1.0, 3
"""A dip is a fade if it leaves less than this part of the contrast that there is within so many seconds on either side,
over so many frames at least."""
_FLICKER_REACH, _LEAST_FLICKER = 3, 0.02
"""Frames on either side whose median light a flickering picture gets, and the median deviation that is a flicker."""
_FADE_S = 2.0
"""Longest fade-out or fade-in, seconds."""
DISSOLVE_S = 2.0
"""Longest dissolve, seconds."""


def dissolves(window: PictureWindow, begin: int, end: int, longest: int) -> list[Interval]:
    """Dissolves whose middle lies in [begin, end), in order and without overlap.

    They last at most DISSOLVE_S, in which the video shows at most `longest` frames.
    """
    thumbs = np.stack(window.thumbs)
    flicker = _flicker(thumbs)
    thumbs = np.asarray(thumbs / flicker[:, None], thumbs.dtype)
    time_s = window.time_s[window.first : window.end]
    coarse = _halved(thumbs)
    candidates: list[tuple[float, int, int]] = []
    length = _MIN_LENGTH + 1
    while length <= 1.3 * longest + 2:
        candidates += _blends(coarse, time_s, length)
        length = max(length + 1, round(length * 1.25))
    found: list[Interval] = []
    for _, first, last in sorted(candidates):
        middle = window.first + (first + last) // 2
        if not begin <= middle < end or any(s.start - 2 <= middle < s.end + 2 for s in found):
            continue
        span = _ramp(thumbs, time_s, first, last, longest)
        if span is None:
            continue
        start, stop = window.first + span.start, window.first + span.end
        if any(start < s.end and s.start < stop for s in found):
            continue
        ends = start - 1, stop
        detail = BlendDetail.of(window, *ends, flicker)
        if detail.lost < _LOST_DETAIL or detail.error > _MAX_DETAIL_ERROR or window.displacement(*ends) is not None:
            continue
        is_clear = stop - start >= _CLEAR_FRAMES and detail.error <= _CLEAR_ERROR
        if window.motion(*ends).match > _UNRELATED and not is_clear and explained_detail(window, *ends) < _BLENDED:
            continue
        found.append(Interval(start, stop))
    return sorted(found)


def _flicker(thumbs: np.ndarray) -> np.ndarray:
    """(n,) by how much lighter each of n small pictures (n,m), a row each, is than those around it, if their light
    flickers; else ones.

    Lamps that flicker, and exposures that hunt, bend the ramp of a blend; a fade changes the light for longer.
    """
    light = thumbs.mean(axis=1)
    around = sliding_window_view(np.pad(light, _FLICKER_REACH, mode="edge"), 2 * _FLICKER_REACH + 1)
    even = np.median(around, axis=-1)
    flicker = np.maximum(light, 1.0) / np.maximum(even, 1.0)
    return flicker if np.median(np.abs(flicker - 1)) >= _LEAST_FLICKER else np.ones(len(thumbs))


@dataclass(frozen=True)
class BlendDetail:
    """What the pictures between two frames have of the detail that a blend of these would have."""

    lost: float
    """How much less detail the middle has than pictures on the way from one to the other would have: 1 in a blend of
    two pictures that have nothing in common, 0 in a pan."""
    error: float
    """Root-mean-square deviation from a blend's detail, as a part of that of pictures on the way."""

    @classmethod
    def of(cls, window: PictureWindow, before: int, after: int, flicker: np.ndarray) -> Self:
        """Of the frames between two, where nothing is burned into all of them; `flicker`: of the window's frames."""
        frames = np.arange(before + 1, after)
        weight = (window.time_s[frames] - window.time_s[before]) / (window.time_s[after] - window.time_s[before])
        filmed = _filmed(window, before, after)
        light = flicker[before - window.first : after + 1 - window.first]
        seen = np.array([window.detail_variance(frame, filmed) for frame in range(before, after + 1)]) / light**2
        common = float(np.mean(window.detail(before)[filmed] * window.detail(after)[filmed])) / (light[0] * light[-1])
        moved = np.maximum((1 - weight) * seen[0] + weight * seen[-1], 1e-6)
        unrelated = (1 - weight) ** 2 * seen[0] + weight**2 * seen[-1]
        mixed = unrelated + 2 * weight * (1 - weight) * common
        middle = np.abs(weight - 0.5) < 0.25
        if not middle.any():
            middle = np.abs(weight - 0.5) == np.abs(weight - 0.5).min()
        lost = (moved - seen[1:-1]) / np.maximum(moved - unrelated, 1e-6)
        return cls(float(np.median(lost[middle])), float(np.sqrt(np.mean(((seen[1:-1] - mixed) / moved) ** 2))))


def explained_detail(window: PictureWindow, before: int, after: int) -> float:
    """The part, 0..1, of the detail midway between two frames that a blend of theirs explains."""
    filmed = _filmed(window, before, after)
    ends = np.stack([window.detail(frame)[filmed] for frame in (before, after)], axis=1)
    middle = window.detail((before + after) // 2)[filmed]
    weights = np.linalg.lstsq(ends.T @ ends, ends.T @ middle, rcond=None)[0]
    left = middle - ends @ weights
    return float(1 - left @ left / max(float(middle @ middle), 1e-6))


def _filmed(window: PictureWindow, before: int, after: int) -> np.ndarray:
    """(h,w) bool: where nothing is burned into all of a span; of a pan's ends some part may be alike by chance."""
    return np.asarray(window.filmed(before, after) | window.filmed(before, (before + after) // 2))


def _blends(thumbs: np.ndarray, time_s: np.ndarray, length: int) -> list[tuple[float, int, int]]:
    """(residual, first, last) of the windows first..last = first + length whose quarters are blends of their ends."""
    if len(thumbs) <= length:
        return []
    head, tail = thumbs[:-length], thumbs[length:]
    difference = tail - head
    energy = np.einsum("td,td->t", difference, difference)
    worst = np.zeros(len(head))
    weights = []
    for quarter in (0.25, 0.5, 0.75):
        step = round(length * quarter)
        inner = thumbs[step : step + len(head)] - head
        weight = np.einsum("td,td->t", inner, difference) / np.maximum(energy, 1e-6)
        left = inner - weight[:, None] * difference
        worst = np.maximum(worst, np.sqrt(np.einsum("td,td->t", left, left) / np.maximum(energy, 1e-6)))
        # the weight at the quarter itself: where frames are unevenly apart, the frame there is early or late
        passed = (time_s[step : step + len(head)] - time_s[: len(head)]) / (time_s[length:] - time_s[: len(head)])
        weights.append(weight + step / length - passed)
    rising = (weights[0] < 0.42) & (np.abs(weights[1] - 0.5) < 0.2) & (weights[2] > 0.58)
    # a hard cut in the window gives weights 0, 0, 1: some change must happen in each half
    gradual = (weights[1] - weights[0] > 0.1) & (weights[2] - weights[1] > 0.1)
    strong = energy > _MIN_DIFFERENCE**2 * thumbs.shape[1]
    good = np.flatnonzero(rising & gradual & strong & (worst < _WORST_RESIDUAL))
    # of equally good windows the longest covers the whole ramp: prefer a large difference between the ends
    return [(float(worst[t] - np.sqrt(energy[t] / thumbs.shape[1]) / 100), int(t), int(t) + length) for t in good]


def _ramp(thumbs: np.ndarray, time_s: np.ndarray, first: int, last: int, longest: int) -> Interval | None:
    """Frames of the dissolve about the window first..last (indices into thumbs), or None if there is no ramp.

    The pictures just outside the window stand for the two scenes; walking outwards from the middle, the dissolve lasts
    as long as every frame makes a fair step, for its time, from the one scene to the other. The frames found are the
    next window.
    """
    for _ in range(4):
        difference = thumbs[last] - thumbs[first]
        energy = max(float(difference @ difference), 1e-6)
        low, high = max(0, first - longest // 2), min(len(thumbs) - 1, last + longest // 2)
        weight = (thumbs[low : high + 1] @ difference - thumbs[first] @ difference) / energy
        interval = np.diff(time_s[low : high + 1])
        # steps[i] leads from frame low + i to low + i + 1; an even step makes 1 / (last − first) of the change
        even = interval * (last - first) / (time_s[last] - time_s[first])
        steps = _median_of_three(np.diff(weight) / even)
        fair = _FAIR_STEP / max(_MIN_LENGTH, last - first)
        middle = (first + last) // 2 - low
        start, stop = middle, middle
        while start > 0 and steps[start - 1] > fair:
            start -= 1
        while stop < len(steps) and steps[stop] > fair:
            stop += 1
        found = low + start, low + stop
        if found[1] - found[0] < 2 or found == (first, last):
            break
        first, last = found
    if not _MIN_LENGTH <= last - first - 1 <= longest or time_s[last - 1] - time_s[first + 1] > DISSOLVE_S:
        return None
    frame = np.arange(first + 1, last)
    difference = thumbs[last] - thumbs[first]
    energy = max(float(difference @ difference), 1e-6)
    weight = (thumbs[frame] - thumbs[first]) @ difference / energy
    straight = (time_s[frame] - time_s[first]) / (time_s[last] - time_s[first])
    error = float(np.sqrt(np.mean((weight - straight) ** 2)))
    left = thumbs[frame] - thumbs[first] - weight[:, None] * difference
    residual = float(np.sqrt((left**2).sum(axis=1) / energy).mean())
    steps, even_steps = (np.diff(np.r_[0.0, of_frame, 1.0]) for of_frame in (weight, straight))
    leaps = bool((steps >= np.minimum(_MAX_LEAP, _LEAP_TIMES * even_steps)).any())
    ramp = error < _MAX_RAMP_ERROR and residual < _MAX_RESIDUAL and not leaps
    return Interval(first + 1, last) if ramp else None


def _halved(thumbs: np.ndarray) -> np.ndarray:
    """The thumbnails at half the width and height: enough to see where a blend may be."""
    width, height = THUMB
    quads = thumbs.reshape(len(thumbs), height // 2, 2, width // 2, 2, 3)
    return np.asarray(quads.mean(axis=(2, 4)).reshape(len(thumbs), -1))


def _median_of_three(values: np.ndarray) -> np.ndarray:
    padded = np.pad(values, 1, mode="edge")
    return np.asarray(np.median(np.stack([padded[:-2], padded[1:-1], padded[2:]]), axis=0))


def most_frames(time_s: np.ndarray, duration_s: float) -> int:
    """The most frames that are shown within a duration anywhere in a video."""
    first_after = np.searchsorted(time_s, time_s + duration_s - ROUNDING_S)
    return int((first_after - np.arange(len(time_s))).max())


def uniform_runs(uniform: Sequence[bool]) -> list[Interval]:
    """Runs of uniform pictures that touch neither end of the video."""
    runs = runs_of_true(np.asarray(uniform, bool))
    return [run for run in runs if run.start > 0 and run.end < len(uniform)]


def dips(contrast: Sequence[float], time_s: np.ndarray) -> list[Interval]:
    """Fades in which no picture is uniform, as short ones may be: the contrast falls evenly for some frames, to next to
    nothing, and rises again."""
    values = np.asarray(contrast)
    found = []
    for run in runs_of_true(_is_dim(values, time_s)):
        if run.start == 0 or run.end == len(values):
            continue
        whole = fade_around(contrast, run, time_s)
        sides = values[whole.start : run.start][::-1], values[run.end : whole.end]
        if all(len(side) >= _LEAST_RAMP and (np.diff(side) > 0).all() for side in sides):
            found.append(whole)
    return found


def _is_dim(contrast: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    """(F,) bool: less than _DIP of what the contrast reaches within _DIP_S before, and within as much after."""
    before, after = (np.searchsorted(time_s, time_s + by_s) for by_s in (-_DIP_S, _DIP_S))
    reached = [
        min(contrast[first : k + 1].max(), contrast[k:last].max(initial=0.0))
        for k, (first, last) in enumerate(zip(before, after, strict=True))
    ]
    return np.asarray(contrast < _DIP * np.array(reached))


def fade_around(contrast: Sequence[float], run: Interval, time_s: np.ndarray) -> Interval:
    """The fade-out, the uniform pictures and the fade-in; the run itself where the picture changes at once."""
    values = np.asarray(contrast)
    first = int(np.searchsorted(time_s, time_s[run.start - 1] - _FADE_S + ROUNDING_S))
    last = int(np.searchsorted(time_s, time_s[run.end] + _FADE_S - ROUNDING_S))
    out = slice(max(0, min(first, run.start - 2)), run.start)
    into = slice(run.end, max(last, run.end + 2))
    out_length = _ramp_length(values[out][::-1], (time_s[run.start] - time_s[out])[::-1])
    into_length = _ramp_length(values[into], time_s[into] - time_s[run.end - 1])
    return Interval(run.start - out_length, run.end + into_length)


def meeting_blends(contrast: Sequence[float], blends: Sequence[Interval]) -> tuple[list[Interval], list[Interval]]:
    """Dissolves, and fades through a picture that is dim but not uniform: blends that meet are one transition."""
    bright: list[Interval] = []
    dim: list[Interval] = []
    for whole in merged(blends, gap=_MEETING):
        around = min(contrast[whole.start - 1], contrast[min(whole.end, len(contrast) - 1)])
        is_dim = whole not in blends and min(contrast[whole.start : whole.end]) < _DIM * around
        (dim if is_dim else bright).append(whole)
    return bright, dim


def _ramp_length(contrast: np.ndarray, away_s: np.ndarray) -> int:
    """Frames, from the first on, in which the contrast still climbs in a straight line towards its full value.

    `away_s`: seconds of each frame from the uniform picture next to the first.
    """
    climb = 0
    while climb + 1 < len(contrast) and contrast[climb + 1] > contrast[climb] * 1.01 + 0.1:
        climb += 1
    full = float(np.median(contrast[climb : climb + 5]))
    fraction = contrast[: climb + 1] / max(full, 1e-6)
    inside = np.flatnonzero((fraction > _RAMP_RANGE[0]) & (fraction < _RAMP_RANGE[1]))
    if len(inside) < 2:
        return int(np.count_nonzero(fraction < _RAMP_RANGE[1]))
    slope, offset = np.polyfit(away_s[inside], fraction[inside], 1)
    if slope <= 0:
        return 0
    half_shown_s = np.diff(away_s, append=2 * away_s[-1] - away_s[-2]) / 2
    return int(np.count_nonzero(away_s + half_shown_s < (1 - offset) / slope))
