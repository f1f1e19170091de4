"""Charts of a report's page: grouped bars with their intervals, and curves about a cut, as matplotlib's figures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from humanmm.models.benchmark.tables.rows import ANGLES_DEG, Metric, Row, angle_key
from humanmm.models.drawing.figure import CSS_DPI, GRID, TEXT, TOOLTIP, axes_at, new_figure, quiet_axes

CHARTED = (
    ("wa_mpjpe100_mm", "WA-MPJPE, mm"), ("pa_mpjpe_mm", "PA-MPJPE, mm"), ("roe_deg", "ROE, degrees"),
    ("rte_m", "RTE, metres"), ("foot_sliding_mm", "foot sliding, mm a frame"), ("jitter", "jitter, 10 m/s³"),
)  # fmt: skip
OF_CUTS = (("cut_f1", "F1"), ("cut_precision", "precision"), ("cut_recall", "recall"))

TRUTH = -1
"""Series of the truth in a drawing."""
_COLOURS = (
    "#2f6fed", "#d1495b", "#edae49", "#66a182", "#8d6cab", "#5c6770", "#b86b2f", "#2fa7b8", "#c04fa0", "#7a9a01",
    "#d000a0",
)  # fmt: skip
_WIDTH_PX, _HEIGHT_PX, _LEFT_PX, _TICKS_PX, _LABEL_PX = 900, 260, 54, 24, 20


@dataclass(frozen=True)
class Chart:
    """Grouped bars: a group for each label, in it a bar for each series."""

    title: str
    groups: tuple[str, ...]
    series: tuple[tuple[str, tuple[Metric | None, ...]], ...]


@dataclass(frozen=True)
class Curves:
    """Lines over a common axis; None where a line has no value."""

    title: str
    axis: str
    at: tuple[float, ...]
    series: tuple[tuple[str, tuple[float | None, ...]], ...]


def bars_of(rows: Sequence[Row], charted: Sequence[tuple[str, str]]) -> tuple[Chart, ...]:
    """A chart for each figure and its title: a group for every split, a bar for every method."""
    splits, methods, metrics = _by_method_and_split(rows)
    return tuple(
        Chart(title, splits, tuple((m, tuple(metrics.get((m, s), {}).get(key) for s in splits)) for m in methods))
        for key, title in charted
    )


def charts_of(rows: Sequence[Row]) -> tuple[Chart, ...]:
    """The camera's error per angle of the cut, then the main figures per split."""
    splits, methods, metrics = _by_method_and_split(rows)
    bounds = list(pairwise(ANGLES_DEG))
    series = tuple((m, tuple(metrics.get((m, splits[-1]), {}).get(angle_key(*b)) for b in bounds)) for m in methods)
    title = "Error of the camera's rotation at a cut, degrees, by the angle of the cut"
    return (Chart(title, tuple(f"{low}–{high}°" for low, high in bounds), series), *bars_of(rows, CHARTED))


def colour_of(series: int) -> str:
    """#rrggbb of a method by its number, or of the truth."""
    return TEXT if series == TRUTH else _COLOURS[series % len(_COLOURS)]


def legend(chart: Chart | Curves) -> list[tuple[str, str]]:
    """Name and colour of every series."""
    return [(name, colour_of(k)) for k, (name, _) in enumerate(chart.series)]


def chart_figure(chart: Chart) -> Figure:
    """Means as bars, 95 % intervals as lines; a value that is missing has no bar."""
    figure, axes = _axes(below_px=_TICKS_PX)
    width, top = 0.8 / max(len(chart.series), 1), 1e-9
    for k, (name, metrics) in enumerate(chart.series):
        for g, (group, metric) in enumerate(zip(chart.groups, metrics, strict=True)):
            if metric is None:
                continue
            x = g - 0.4 + (k + 0.5) * width
            said = f"{TOOLTIP}{name}, {group}: {metric.mean:.4g}"
            axes.bar(x, metric.mean, 0.9 * width, color=colour_of(k), gid=said)
            axes.plot([x, x], metric.ci95, color=TEXT, linewidth=0.8)
            top = max(top, metric.mean, metric.ci95[1])
    axes.set(xlim=(-0.5, len(chart.groups) - 0.5), ylim=(0, 1.05 * top))
    axes.set_xticks(range(len(chart.groups)), chart.groups)
    axes.tick_params(axis="x", length=0)
    return figure


def curves_figure(curves: Curves) -> Figure:
    """Lines, broken where a value is missing; the cut is a vertical line at 0."""
    figure, axes = _axes(below_px=_TICKS_PX + _LABEL_PX)
    top = max([value for _, values in curves.series for value in values if value is not None], default=1e-9)
    axes.axvline(0, color="#8a9099", linewidth=0.8, linestyle=(0, (4, 3)))
    for k, (name, values) in enumerate(curves.series):
        axes.plot(curves.at, np.array(values, float), color=colour_of(k), linewidth=1.5, gid=f"{TOOLTIP}{name}")
    axes.set(xlim=(curves.at[0], curves.at[-1]), ylim=(0, 1.05 * top))
    axes.set_xticks(np.arange(np.ceil(curves.at[0] * 2) / 2, curves.at[-1] + 1e-9, 0.5))
    axes.set_xlabel(curves.axis, color=TEXT, fontsize=8)
    return figure


def _axes(*, below_px: int) -> tuple[Figure, Axes]:
    figure = new_figure(_WIDTH_PX, _HEIGHT_PX + below_px, dpi=CSS_DPI)
    axes = axes_at(figure, _LEFT_PX, 8, 12, _HEIGHT_PX - 8)
    quiet_axes(axes)
    axes.spines["left"].set_visible(False)
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="y", color=GRID, linewidth=0.8)
    return figure, axes


def _by_method_and_split(
    rows: Sequence[Row],
) -> tuple[tuple[str, ...], tuple[str, ...], dict[tuple[str, str], Mapping[str, Metric]]]:
    """Splits, methods, and the figures by method and split."""
    splits = tuple(dict.fromkeys(row.split for row in rows))
    methods = tuple(dict.fromkeys(row.method for row in rows))
    return splits, methods, {(row.method, row.split): row.metrics for row in rows}
