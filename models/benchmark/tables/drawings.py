"""What a report's page shows of single videos: paths and bodies from three sides, camera views; error about a cut."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from humanmm.models.benchmark.scores import MethodFigures, VideoFigures
from humanmm.models.benchmark.tables.charts import TRUTH, Curves, colour_of
from humanmm.models.benchmark.traces import OFFSETS_S, VideoTraces
from humanmm.models.drawing.figure import CSS_DPI, new_figure

Array = np.ndarray

Lines = Sequence[tuple[int, Array]]
"""Series (index of a method, or TRUTH) and points, NaN where there is none."""

BASELINE = "concat"
"""The method that is drawn beside the first."""
RANKED_BY = "wa_mpjpe100_mm"
_LIMBS = ((4, 2, 0, 1, 3, 5), (0, 6, 8, 10), (1, 7, 9, 11), (6, 7))
"""Polylines through the twelve limb joints: arms, both sides, hips."""
_BODY_APART_M = 0.5
"""On a short path fewer bodies are drawn: one on top of another shows nothing."""
_MARGIN_M, _MARGIN = 0.2, 0.05


@dataclass(frozen=True, eq=False)
class Drawing:
    """A figure and what stands below it."""

    title: str
    figure: Figure


@dataclass(frozen=True)
class Case:
    """One video of a report with its drawings: the truth, the first method and the baseline."""

    video: str
    split: str
    facts: str
    """Its figures, or why there are none."""
    world_views: tuple[Drawing, ...] = ()
    camera_views: tuple[Drawing, ...] = ()
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
    """One video; without traces it has no drawings."""
    case = Case(figures.video, figures.split, _in_words(figures), overlay=overlay)
    if trace is None:
        return case
    return replace(case, world_views=world_views(trace, _drawn(trace.methods)), camera_views=camera_views(trace))


def drawn_methods(methods: Sequence[str]) -> list[tuple[str, str]]:
    """Name and colour of everything that a case draws."""
    return [("the truth", colour_of(TRUTH)), *((methods[k], colour_of(k)) for k in _drawn(methods))]


def _drawn(methods: Sequence[str]) -> list[int]:
    return [k for k, method in enumerate(methods) if k == 0 or method == BASELINE]


def world_views(trace: VideoTraces, shown: Sequence[int]) -> tuple[Drawing, ...]:
    """Paths and bodies of the truth and some methods from two sides and from above; the first side shows the true path
    at its widest."""
    path = trace.path[0].astype(np.float64)
    flat = path[np.isfinite(path).all(axis=1), :2]
    along = np.linalg.svd(flat - flat.mean(axis=0), full_matrices=False)[2][0] if len(flat) > 1 else np.array([1.0, 0])
    along = along * (1.0 if along[np.abs(along).argmax()] > 0 else -1.0)
    x, y, z = np.array([*along, 0.0]), np.array([-along[1], along[0], 0.0]), np.array([0.0, 0.0, 1.0])
    num_bodies = trace.bodies.shape[1]
    reach_m = float(np.ptp(flat, axis=0).max()) if len(flat) else 0.0
    count = int(np.clip(reach_m / _BODY_APART_M + 2, 2, num_bodies))
    some = np.unique(np.linspace(0, num_bodies - 1, count).round().astype(int))
    rows = [(TRUTH, 0), *((k, 1 + k) for k in shown)]
    views = (("from the side", x, -z), ("from the other side", y, -z), ("from above", x, -y))
    return tuple(
        _drawing(
            title,
            [(series, trace.path[row] @ np.stack([right, down], 1)) for series, row in rows],
            [(series, trace.bodies[row][some] @ np.stack([right, down], 1)) for series, row in rows],
            fit_px=(460, 220), margin_m=_MARGIN_M,
        )
        for title, right, down in views
    )  # fmt: skip


def camera_views(trace: VideoTraces) -> tuple[Drawing, ...]:
    """What the true camera sees of the truth and what the first method's camera sees of its body, at some moments."""
    num_bodies = trace.bodies.shape[1]
    shown = trace.frame[:: max(1, len(trace.frame) // max(1, num_bodies))]
    views = []
    for k, frame in enumerate(shown[:num_bodies]):
        bodies = [(TRUTH, trace.pixels[0][k : k + 1]), (0, trace.pixels[1][k : k + 1])]
        if all(np.isfinite(body).any() for _, body in bodies):
            views.append(_drawing(f"camera, frame {frame}", [], bodies, fit_px=(120, 130), margin_m=None))
    return tuple(views)


def _drawing(title: str, paths: Lines, bodies: Lines, *, fit_px: tuple[int, int], margin_m: float | None) -> Drawing:
    """Paths thick and bodies thin, to scale, in at most `fit_px` (width, height); `margin_m` None: one in proportion.

    Points (…,2) have y down; NaN is not drawn.
    """
    everything = np.concatenate([points.reshape(-1, 2) for _, points in [*paths, *bodies]])
    known = everything[np.isfinite(everything).all(axis=1)].astype(np.float64)
    margin = _MARGIN * float(np.ptp(known, axis=0).max()) if margin_m is None else margin_m
    low, high = known.min(axis=0) - margin, known.max(axis=0) + margin
    size = np.maximum(high - low, 1e-9)
    figure = new_figure(*(size * (fit_px / size).min()), dpi=CSS_DPI)
    axes = figure.add_axes((0, 0, 1, 1), xlim=(low[0], high[0]), ylim=(high[1], low[1]))
    axes.set_axis_off()
    for series, body in bodies:
        axes.plot(*_limbs(body).T, color=colour_of(series), linewidth=0.9, alpha=0.55)
    for series, path in paths:
        axes.plot(*path.T, color=colour_of(series), linewidth=1.5)
    return Drawing(title if margin_m is None else f"{title}, {size[0]:.1f} m wide", figure)


def _limbs(bodies: Float[Array, "bodies 12 2"]) -> Float[Array, "n 2"]:
    """The limbs of all bodies as one line with gaps (NaN)."""
    gap = np.full((len(bodies), 1, 2), np.nan)
    parts = [part for limb in _LIMBS for part in (bodies[:, list(limb)], gap)]
    return np.concatenate(parts, axis=1).reshape(-1, 2)


def _ranked(method: MethodFigures) -> float | None:
    return next((figure.value for figure in method.figures if figure.name == RANKED_BY), None)


def _in_words(figures: VideoFigures) -> str:
    first = figures.methods[0]
    if first.failure:
        return f"failed: {first.failure}"
    values = {figure.name: figure.value for figure in first.figures}
    named = (("WA-MPJPE", RANKED_BY, "mm"), ("PA-MPJPE", "pa_mpjpe_mm", "mm"), ("ROE", "roe_deg", "°"),
             ("RTE", "rte_m", "m"), ("camera rotation at cuts", "cam_cut_rot_deg", "°"))  # fmt: skip
    return ", ".join(f"{name} {values[key]:.3g} {unit}" for name, key, unit in named if key in values)
