"""What a report's page shows besides tables: error about a cut, ways and bodies from three sides, camera views."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from humanmm.models.benchmark.scores import MethodFigures, VideoFigures
from humanmm.models.benchmark.traces import OFFSETS_S, VideoTraces
from humanmm.models.geometry.intervals import runs_of_true

Array = np.ndarray

TRUTH = -1
"""Series of the truth in a drawing."""
BASELINE = "concat"
"""The method that is drawn beside the first."""
RANKED_BY = "wa_mpjpe100_mm"
_LIMBS = ((4, 2, 0, 1, 3, 5), (0, 6, 8, 10), (1, 7, 9, 11), (6, 7))
"""Polylines through the twelve limb joints: arms, both sides, hips."""
_BODY_APART_M = 0.5
"""On a short way fewer bodies are drawn: one on top of another shows nothing."""
_MARGIN_M, _MARGIN_SHARE = 0.2, 0.05


@dataclass(frozen=True)
class Curves:
    """Lines over a common axis; None where a line has no value."""

    title: str
    axis: str
    at: tuple[float, ...]
    series: tuple[tuple[str, tuple[float | None, ...]], ...]


@dataclass(frozen=True)
class Stroke:
    """A line through points of a drawing, y down."""

    series: int
    """Index of the method, or TRUTH."""
    is_way: bool
    points: Float[Array, "n 2"]


@dataclass(frozen=True)
class Drawing:
    """Lines in a rectangle from (0, 0) to (width, height)."""

    title: str
    width: float
    height: float
    strokes: tuple[Stroke, ...]


@dataclass(frozen=True)
class Case:
    """One video of a report."""

    video: str
    split: str
    facts: str
    """Its figures, or why there are none."""
    drawings: tuple[Drawing, ...]
    overlay: str = ""
    """Link to a video, from the page; empty if there is none."""


def error_about_cuts(traces: Sequence[VideoTraces]) -> Curves | None:
    """Mean over all cuts of all videos for every method, where at least half of them reach; None if there is no cut."""
    if not traces or not sum(trace.cut_error_mm.shape[1] for trace in traces):
        return None
    series = []
    for k, method in enumerate(traces[0].methods):
        stacked = np.concatenate([trace.cut_error_mm[k] for trace in traces])
        known = np.isfinite(stacked)
        total = np.where(known, stacked, 0).sum(axis=0)
        count = known.sum(axis=0)
        enough = max(1, -(-int(count.max()) // 2))
        values = tuple(float(t / c) if c >= enough else None for t, c in zip(total, count, strict=True))
        series.append((method, values))
    title = "Error of the joints about a cut, mm, after one rigid motion over the second before it"
    return Curves(title, "seconds after the cut", OFFSETS_S, tuple(series))


def worst_cases(videos: Sequence[VideoFigures], count: int) -> list[int]:
    """Indices of the videos in which the first method does worst; failures come first."""

    def rank(index: int) -> tuple[float, str]:
        value = _ranked(videos[index].methods[0])
        return (-value if value is not None else -np.inf, videos[index].video)

    return sorted(range(len(videos)), key=rank)[:count]


def median_cases(videos: Sequence[VideoFigures]) -> list[int]:
    """Index of the middle video of every split, by the first method."""
    found = []
    for split in dict.fromkeys(video.split for video in videos):
        known = [k for k, video in enumerate(videos) if video.split == split and _ranked(video.methods[0]) is not None]
        known.sort(key=lambda k: (_ranked(videos[k].methods[0]) or 0.0, videos[k].video))
        if known:
            found.append(known[len(known) // 2])
    return found


def case_of(figures: VideoFigures, trace: VideoTraces | None, *, overlay: str = "") -> Case:
    """One video with its drawings: the truth, the first method and the baseline."""
    drawings: tuple[Drawing, ...] = ()
    if trace is not None:
        shown = [0, *(k for k, method in enumerate(trace.methods) if method == BASELINE and k)]
        drawings = (*three_views(trace, shown), *camera_views(trace))
    return Case(figures.video, figures.split, _in_words(figures), drawings, overlay)


def three_views(trace: VideoTraces, shown: Sequence[int]) -> tuple[Drawing, ...]:
    """The ways and bodies of the truth and some methods from the side, from the other side, and from above.

    The side is where the truth's way is widest.
    """
    way = trace.way[0].astype(np.float64)
    flat = way[np.isfinite(way).all(axis=1), :2]
    along = np.linalg.svd(flat - flat.mean(axis=0), full_matrices=False)[2][0] if len(flat) > 1 else np.array([1.0, 0])
    along = along * (1.0 if along[np.abs(along).argmax()] > 0 else -1.0)
    across = np.array([-along[1], along[0]])
    x, y, z = np.array([*along, 0.0]), np.array([*across, 0.0]), np.array([0.0, 0.0, 1.0])
    reach_m = float(np.ptp(flat, axis=0).max()) if len(flat) else 0.0
    every = np.linspace(
        0, trace.bodies.shape[1] - 1, int(np.clip(reach_m / _BODY_APART_M + 2, 2, trace.bodies.shape[1]))
    )
    some = np.unique(every.round().astype(int))
    series = [TRUTH, *shown]
    rows = [0, *(1 + k for k in shown)]
    views = (("from the side", x, -z), ("from the other side", y, -z), ("from above", x, -y))
    return tuple(
        _drawing(
            title,
            [(s, trace.way[r] @ np.stack([right, down], 1)) for s, r in zip(series, rows, strict=True)],
            [(s, trace.bodies[r][some] @ np.stack([right, down], 1)) for s, r in zip(series, rows, strict=True)],
            margin=_MARGIN_M,
        )
        for title, right, down in views
    )


def camera_views(trace: VideoTraces) -> tuple[Drawing, ...]:
    """What the true camera sees of the truth and what the first method's camera sees of its body, at some moments."""
    shown = trace.frame[:: max(1, len(trace.frame) // max(1, trace.bodies.shape[1]))]
    views = []
    for k, frame in enumerate(shown[: trace.bodies.shape[1]]):
        bodies = [(TRUTH, trace.pixels[0][k : k + 1]), (0, trace.pixels[1][k : k + 1])]
        if all(np.isfinite(body).any() for _, body in bodies):
            views.append(_drawing(f"camera, frame {frame}", [], bodies, margin=None))
    return tuple(views)


def _drawing(
    title: str,
    ways: Sequence[tuple[int, Array]],
    bodies: Sequence[tuple[int, Array]],
    *,
    margin: float | None,
) -> Drawing:
    """Ways and bodies moved so that all have room; `margin` None: a share of the size instead."""
    everything = np.concatenate([points.reshape(-1, 2) for _, points in [*ways, *bodies]])
    known = everything[np.isfinite(everything).all(axis=1)].astype(np.float64)
    low, high = known.min(axis=0), known.max(axis=0)
    space = _MARGIN_SHARE * float(np.ptp(known, axis=0).max()) if margin is None else margin
    low, high = low - space, high + space
    strokes = [
        Stroke(s, False, run) for s, b in bodies for body in b for limb in _LIMBS for run in _runs(body[[*limb]])
    ]
    strokes += [Stroke(s, True, run) for s, way in ways for run in _runs(way)]
    moved = tuple(Stroke(stroke.series, stroke.is_way, stroke.points - low) for stroke in strokes)
    if margin is not None:
        title = f"{title}, {high[0] - low[0]:.1f} m wide"
    return Drawing(title, float(high[0] - low[0]), float(high[1] - low[1]), moved)


def _runs(points: Float[Array, "n 2"]) -> list[Float[Array, "m 2"]]:
    """The stretches of two and more known points."""
    known = np.isfinite(points).all(axis=1)
    return [points[a:b].astype(np.float64) for a, b in runs_of_true(known) if b - a > 1]


def _ranked(method: MethodFigures) -> float | None:
    return next((figure.value for figure in method.figures if figure.name == RANKED_BY), None)


def _in_words(figures: VideoFigures) -> str:
    first = figures.methods[0]
    if first.failure:
        return f"failed: {first.failure}"
    values = {figure.name: figure.value for figure in first.figures}
    named = (("WA-MPJPE", RANKED_BY, "mm"), ("PA-MPJPE", "pa_mpjpe_mm", "mm"), ("ROE", "roe_deg", "°"),
             ("RTE", "rte_m", "m"), ("camera's turn at cuts", "cam_cut_rot_deg", "°"))  # fmt: skip
    return ", ".join(f"{name} {values[key]:.3g} {unit}" for name, key, unit in named if key in values)
