"""Gradual transitions: a dissolve is a linear blend of two pictures, a fade passes through a uniform one.

Dissolve over [s, e): thumbnail T_t = (1 − a_t) T_before + a_t T_after with a_t rising linearly from 0 to 1. A pan or a
walking person makes no such blend: in its middle it shows what neither end shows.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from humanmm.models.shots.footage import Footage
from humanmm.models.shots.hard_cuts import MATCHED

_MIN_LENGTH = 3
"""A blend of fewer frames is a hard cut."""
_MIN_DIFFERENCE = 8.0
"""Root-mean-square difference in grey levels that two ends must have."""
_MAX_RESIDUAL = 0.35
"""Largest part of the ends' difference that a blend may leave unexplained (motion in either scene meanwhile)."""
_MAX_RAMP_ERROR = 0.08
"""Root-mean-square deviation of the blend weight from a straight ramp."""
_UNIFORM = 4.0
"""Contrast (grey levels) below which a picture is uniform: a black or white frame after coding."""
_RAMP_RANGE = (0.15, 0.85)
"""Share of the full contrast between which a fade's ramp is fitted; coding noise bends its ends."""
_FADE_S = 2.0
"""Longest fade-out or fade-in, seconds."""
DISSOLVE_S = 2.0
"""Longest dissolve, seconds."""


@dataclass(frozen=True)
class Span:
    """Frames [start, end) inside a gradual transition."""

    start: int
    end: int


def dissolves(footage: Footage, begin: int, end: int, longest: int) -> list[Span]:
    """Dissolves whose middle lies in [begin, end), at most `longest` frames long, in order and without overlap."""
    thumbs = np.stack(footage.thumbs)
    candidates: list[tuple[float, int, int]] = []
    length = _MIN_LENGTH + 1
    while length <= 1.3 * longest + 2:
        candidates += _blends(thumbs, length)
        length = max(length + 1, round(length * 1.25))
    found: list[Span] = []
    for _, first, last in sorted(candidates):
        middle = footage.first + (first + last) // 2
        if not begin <= middle < end or any(s.start - 2 <= middle < s.end + 2 for s in found):
            continue
        span = _ramp(thumbs, first, last, longest)
        if span is None:
            continue
        start, stop = footage.first + span.start, footage.first + span.end
        if any(start < s.end and s.start < stop for s in found):
            continue
        if footage.motion(start - 1, stop).match >= MATCHED or footage.displacement(start - 1, stop) is not None:
            continue
        found.append(Span(start, stop))
    return sorted(found, key=lambda s: s.start)


def _blends(thumbs: np.ndarray, length: int) -> list[tuple[float, int, int]]:
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
        weights.append(weight)
    rising = (weights[0] < 0.42) & (np.abs(weights[1] - 0.5) < 0.2) & (weights[2] > 0.58)
    # a hard cut in the window gives weights 0, 0, 1: some change must happen in each half
    gradual = (weights[1] - weights[0] > 0.1) & (weights[2] - weights[1] > 0.1)
    strong = energy > _MIN_DIFFERENCE**2 * thumbs.shape[1]
    good = np.flatnonzero(rising & gradual & strong & (worst < _MAX_RESIDUAL))
    # of equally good windows the longest covers the whole ramp: prefer a large difference between the ends
    return [(float(worst[t] - np.sqrt(energy[t] / thumbs.shape[1]) / 100), int(t), int(t) + length) for t in good]


def _ramp(thumbs: np.ndarray, first: int, last: int, longest: int) -> Span | None:
    """Frames of the dissolve in the window (indices into thumbs), or None if the blend weight is no straight ramp."""
    pad = max(3, (last - first) // 2)
    low, high = max(0, first - pad), min(len(thumbs) - 1, last + pad)
    for _ in range(3):  # the ends become the references of the next round
        difference = thumbs[last] - thumbs[first]
        energy = float(difference @ difference)
        weight = (thumbs[low : high + 1] - thumbs[first]) @ difference / max(energy, 1e-6)
        inside = np.flatnonzero((weight > 0.12) & (weight < 0.88)) + low
        inside = inside[(inside >= first) & (inside <= last)]
        if len(inside) < 2:
            return None
        slope, offset = np.polyfit(inside, weight[inside - low], 1)
        if slope <= 0:
            return None
        begin, finish = -offset / slope, (1 - offset) / slope
        # the ramp passes 0 at the last untouched frame and 1 at the first finished one
        start, stop = round(begin) + 1, round(finish)
        if (start - 1, stop) == (first, last):
            break
        first, last = max(low, start - 1), min(high, stop)
        if last - first < 2:
            return None
    length = stop - start
    frame = np.arange(start, stop)
    if not _MIN_LENGTH <= length <= longest or start < 1 or stop > high or frame[0] < low:
        return None
    ideal = (frame - begin) / (finish - begin)
    error = float(np.sqrt(np.mean((weight[frame - low] - ideal) ** 2)))
    left = thumbs[frame] - thumbs[first] - weight[frame - low, None] * difference
    residual = float(np.sqrt((left**2).sum(axis=1) / max(energy, 1e-6)).mean())
    return Span(start, stop) if error < _MAX_RAMP_ERROR and residual < _MAX_RESIDUAL else None


def uniform_runs(contrast: Sequence[float]) -> list[Span]:
    """Runs of uniform pictures that touch neither end of the video."""
    uniform = np.r_[False, np.asarray(contrast) < _UNIFORM, False]
    edges = np.flatnonzero(uniform[1:] != uniform[:-1])
    runs = [Span(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
    return [run for run in runs if run.start > 0 and run.end < len(contrast)]


def fade_around(contrast: Sequence[float], run: Span, fps: float) -> Span:
    """The fade-out, the uniform pictures and the fade-in; the run itself where the picture changes at once."""
    values = np.asarray(contrast)
    reach = max(2, round(_FADE_S * fps))
    backward = values[max(0, run.start - reach) : run.start][::-1]
    forward = values[run.end : run.end + reach]
    return Span(run.start - _ramp_length(backward), run.end + _ramp_length(forward))


def _ramp_length(contrast: np.ndarray) -> int:
    """Frames, from the first on, in which the contrast still climbs in a straight line towards its full value."""
    climb = 0
    while climb + 1 < len(contrast) and contrast[climb + 1] > contrast[climb] * 1.01 + 0.1:
        climb += 1
    full = float(np.median(contrast[climb : climb + 5]))
    share = contrast[: climb + 1] / max(full, 1e-6)
    inside = np.flatnonzero((share > _RAMP_RANGE[0]) & (share < _RAMP_RANGE[1]))
    if len(inside) < 2:
        return int(np.count_nonzero(share < _RAMP_RANGE[1]))
    slope, offset = np.polyfit(inside, share[inside], 1)
    return int(np.clip(round((1 - offset) / slope), 0, len(contrast))) if slope > 0 else 0
