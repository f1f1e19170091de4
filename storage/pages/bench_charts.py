"""Bars, curves and drawings as SVG, for a page that stands alone."""

import html

import numpy as np

from humanmm.models.benchmark.tables.drawings import TRUTH, Curves, Drawing
from humanmm.models.benchmark.tables.layout import Chart

COLOURS = (
    "#2f6fed", "#d1495b", "#edae49", "#66a182", "#8d6cab", "#5c6770", "#b86b2f", "#2fa7b8", "#c04fa0", "#7a9a01",
    "#d000a0",
)  # fmt: skip
TRUTH_COLOUR = "#23262b"
_WIDTH, _HEIGHT, _LEFT, _BOTTOM = 900, 260, 46, 24


def colour_of(series: int) -> str:
    """Colour of a method by its place, or of the truth."""
    return TRUTH_COLOUR if series == TRUTH else COLOURS[series % len(COLOURS)]


def legend(names: tuple[str, ...]) -> str:
    """Which colour is which."""
    items = [f'<b style="color:{colour_of(k)}">■</b> {html.escape(name)}' for k, name in enumerate(names)]
    return f"<p>{' &nbsp; '.join(items)}</p>"


def as_svg(chart: Chart) -> str:
    """One chart: means as bars, 95 % intervals as lines; a value that is missing has no bar."""
    known = [m for _, values in chart.series for m in values if m is not None]
    top = max([*(m.ci95[1] for m in known), *(m.mean for m in known), 1e-9]) * 1.05
    plot, wide = _HEIGHT - _BOTTOM, (_WIDTH - _LEFT) / max(len(chart.groups), 1)
    bar = 0.8 * wide / max(len(chart.series), 1)

    def y(value: float) -> float:
        return plot - (plot - 8) * value / top

    parts = [f'<svg width="{_WIDTH}" height="{_HEIGHT}" role="img" aria-label="{html.escape(chart.title)}">']
    for tick in (0.0, 0.5, 1.0):
        at = y(tick * top / 1.05)
        parts.append(f'<line x1="{_LEFT}" x2="{_WIDTH}" y1="{at:.1f}" y2="{at:.1f}" stroke="#ddd"/>')
        parts.append(f'<text x="{_LEFT - 4}" y="{at + 4:.1f}" text-anchor="end">{tick * top / 1.05:.3g}</text>')
    for g, group in enumerate(chart.groups):
        left = _LEFT + g * wide + 0.1 * wide
        parts.append(
            f'<text x="{left + 0.4 * wide:.1f}" y="{_HEIGHT - 6}" text-anchor="middle">{html.escape(group)}</text>'
        )
        for k, (name, values) in enumerate(chart.series):
            metric = values[g]
            if metric is None:
                continue
            x, colour = left + k * bar, colour_of(k)
            said = html.escape(f"{name}, {group}: {metric.mean:.4g}")
            parts.append(
                f'<rect x="{x:.1f}" y="{y(metric.mean):.1f}" width="{0.9 * bar:.1f}" '
                f'height="{plot - y(metric.mean):.1f}" fill="{colour}"><title>{said}</title></rect>'
            )
            low, high = (y(value) for value in metric.ci95)
            middle = x + 0.45 * bar
            parts.append(f'<line x1="{middle:.1f}" x2="{middle:.1f}" y1="{high:.1f}" y2="{low:.1f}" stroke="#23262b"/>')
    return "\n".join([*parts, "</svg>"])


def curves_as_svg(curves: Curves) -> str:
    """Lines, broken where a value is missing; the cut is a vertical line at 0."""
    known = [value for _, values in curves.series for value in values if value is not None]
    top, plot = max([*known, 1e-9]) * 1.05, _HEIGHT - _BOTTOM
    first, last = curves.at[0], curves.at[-1]

    def x(at: float) -> float:
        return _LEFT + (_WIDTH - _LEFT - 8) * (at - first) / (last - first)

    def y(value: float) -> float:
        return plot - (plot - 8) * value / top

    parts = [f'<svg width="{_WIDTH}" height="{_HEIGHT + 16}" role="img" aria-label="{html.escape(curves.title)}">']
    for tick in (0.0, 0.5, 1.0):
        at = y(tick * top / 1.05)
        parts.append(f'<line x1="{_LEFT}" x2="{_WIDTH}" y1="{at:.1f}" y2="{at:.1f}" stroke="#ddd"/>')
        parts.append(f'<text x="{_LEFT - 4}" y="{at + 4:.1f}" text-anchor="end">{tick * top / 1.05:.3g}</text>')
    for mark in np.arange(np.ceil(first * 2) / 2, last + 1e-9, 0.5):
        parts.append(f'<text x="{x(float(mark)):.1f}" y="{plot + 16}" text-anchor="middle">{mark:g}</text>')
    parts.append(f'<line x1="{x(0):.1f}" x2="{x(0):.1f}" y1="8" y2="{plot}" stroke="#8a9099" stroke-dasharray="4 3"/>')
    parts.append(
        f'<text x="{_WIDTH / 2:.0f}" y="{_HEIGHT + 12}" text-anchor="middle">{html.escape(curves.axis)}</text>'
    )
    for k, (name, values) in enumerate(curves.series):
        run: list[str] = []
        for at, value in [*zip(curves.at, values, strict=True), (last, None)]:
            if value is not None:
                run.append(f"{x(at):.1f},{y(value):.1f}")
            elif run:
                line = f'<polyline points="{" ".join(run)}" fill="none" stroke="{colour_of(k)}" stroke-width="2">'
                parts.append(f"{line}<title>{html.escape(name)}</title></polyline>")
                run = []
    return "\n".join([*parts, "</svg>"])


def drawing_as_svg(drawing: Drawing, *, height_px: int, widest_px: int) -> str:
    """The drawing to scale, in at most so many pixels: ways thick, bodies thin."""
    scale = min(height_px / max(drawing.height, 1e-9), widest_px / max(drawing.width, 1e-9))
    width, height = scale * drawing.width, scale * drawing.height
    parts = [f'<svg width="{width:.0f}" height="{height:.0f}" role="img" aria-label="{html.escape(drawing.title)}">']
    for stroke in drawing.strokes:
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in scale * stroke.points)
        look = 'stroke-width="2"' if stroke.is_way else 'stroke-width="1.2" stroke-opacity="0.55"'
        parts.append(f'<polyline points="{points}" fill="none" stroke="{colour_of(stroke.series)}" {look}/>')
    return "".join([*parts, "</svg>"])
