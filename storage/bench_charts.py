"""Grouped bars as SVG, for a page that stands alone."""

import html

from humanmm.models.benchmark.tables import Chart

COLOURS = ("#2f6fed", "#d1495b", "#edae49", "#66a182", "#8d6cab", "#5c6770", "#b86b2f", "#2fa7b8")
_WIDTH, _HEIGHT, _LEFT, _BOTTOM = 900, 260, 46, 24


def legend(names: tuple[str, ...]) -> str:
    """Which colour is which."""
    items = [f'<b style="color:{COLOURS[k % len(COLOURS)]}">■</b> {html.escape(name)}' for k, name in enumerate(names)]
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
            x, colour = left + k * bar, COLOURS[k % len(COLOURS)]
            said = html.escape(f"{name}, {group}: {metric.mean:.4g}")
            parts.append(
                f'<rect x="{x:.1f}" y="{y(metric.mean):.1f}" width="{0.9 * bar:.1f}" '
                f'height="{plot - y(metric.mean):.1f}" fill="{colour}"><title>{said}</title></rect>'
            )
            low, high = (y(value) for value in metric.ci95)
            middle = x + 0.45 * bar
            parts.append(f'<line x1="{middle:.1f}" x2="{middle:.1f}" y1="{high:.1f}" y2="{low:.1f}" stroke="#23262b"/>')
    return "\n".join([*parts, "</svg>"])
