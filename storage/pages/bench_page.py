"""A benchmark's report as one HTML page: tables, charts, drawings; nothing is loaded from elsewhere."""

import html
from collections.abc import Sequence
from dataclasses import dataclass

from humanmm.models.benchmark.tables.drawings import BASELINE, TRUTH, Case, Curves, Drawing
from humanmm.models.benchmark.tables.layout import Chart
from humanmm.storage.pages.bench_charts import as_svg, colour_of, curves_as_svg, drawing_as_svg, legend

_STYLE = """
body{font:14px/1.5 system-ui,sans-serif;margin:2rem auto;max-width:84rem;padding:0 1rem;color:#23262b}
code{background:#f2f4f6;padding:.1em .3em} h1{margin-bottom:.2rem} h2{font-size:1.15rem;margin:2.2rem 0 .4rem}
h3{font-size:1rem;margin:1.4rem 0 .2rem} svg text{font-size:11px;fill:#5c6770} .wide{overflow-x:auto}
table{border-collapse:collapse;font-size:12px} td,th{padding:.2rem .55rem;text-align:right} td{white-space:nowrap}
td,th{border-bottom:1px solid #e6e8eb}
th:first-child,td:first-child{text-align:left;white-space:nowrap} th{vertical-align:bottom;font-weight:600}
figure{display:inline-block;margin:.3rem 1.2rem .3rem 0;vertical-align:bottom}
figcaption{font-size:11px;color:#5c6770}
details{margin:.6rem 0;border-top:1px solid #e6e8eb;padding-top:.4rem} summary{cursor:pointer}
"""


@dataclass(frozen=True)
class Page:
    """What a report shows. Texts are plain, not HTML; `table` is Markdown as `tables.as_markdown` makes it."""

    title: str
    created_by: str
    facts: str
    table: str
    methods: Sequence[str] = ()
    charts: Sequence[Chart] = ()
    curves: Sequence[Curves] = ()
    typical: Sequence[Case] = ()
    worst: Sequence[Case] = ()


def as_html(page: Page) -> str:
    """The text of index.html; the same page for the same content."""
    parts = [
        f'<!doctype html><meta charset="utf-8"><title>{html.escape(page.title)}</title><style>{_STYLE}</style>',
        f"<h1>{html.escape(page.title)}</h1><p>Made by <code>{html.escape(page.created_by)}</code>. "
        f"{html.escape(page.facts)}</p>",
        _tables(page.table),
    ]
    if page.charts:
        names = legend(tuple(name for name, _ in page.charts[0].series))
        parts.append(f"<h2>In pictures</h2><p>Bars are means, lines their 95 % intervals.</p>{names}")
        parts += [f"<h3>{html.escape(chart.title)}</h3>{as_svg(chart)}" for chart in page.charts]
    for curves in page.curves:
        names = legend(tuple(name for name, _ in curves.series))
        parts.append(f"<h3>{html.escape(curves.title)}</h3>{names}{curves_as_svg(curves)}")
    if page.typical:
        parts.append(f"<h2>A middling video of each kind</h2>{_key(page.methods)}")
        parts += [f"<h3>{_head(case)}</h3>{_views(case.drawings)}" for case in page.typical]
    if page.worst:
        parts.append(f"<h2>The worst {len(page.worst)}</h2>{_key(page.methods)}")
        for k, case in enumerate(page.worst):
            summary = f"<summary>{k + 1}. {_head(case)}</summary>"
            parts.append(f"<details{' open' if k < 3 else ''}>{summary}{_views(case.drawings)}</details>")
    return "\n".join(parts) + "\n"


def _key(methods: Sequence[str]) -> str:
    series = [("the truth", TRUTH), *((method, k) for k, method in enumerate(methods) if k == 0 or method == BASELINE)]
    words = " &nbsp; ".join(f'<b style="color:{colour_of(k)}">■</b> {html.escape(name)}' for name, k in series)
    return (
        f"<p>{words}. Ways and bodies are laid on the truth by one rigid motion over the whole video; a camera view "
        "shows what the true camera sees of the truth and what the estimated one sees of the estimate.</p>"
    )


def _head(case: Case) -> str:
    return f"{html.escape(case.video)}, {html.escape(case.split)}: {html.escape(case.facts)}{_link(case)}"


def _link(case: Case) -> str:
    return f' &nbsp; <a href="{html.escape(case.overlay)}">overlay</a>' if case.overlay else ""


def _views(drawings: Sequence[Drawing]) -> str:
    """The views of the world in one row, those of the camera, smaller, in the next."""
    rows = []
    for small in (False, True):
        figures = []
        for drawing in drawings:
            if drawing.title.startswith("camera") is small:
                svg = drawing_as_svg(drawing, height_px=130 if small else 220, widest_px=120 if small else 460)
                figures.append(f"<figure>{svg}<figcaption>{html.escape(drawing.title)}</figcaption></figure>")
        rows.append(f"<div>{''.join(figures)}</div>")
    return "".join(rows)


def _tables(markdown: str) -> str:
    """The headings and tables of a Markdown text as HTML; other lines as paragraphs."""
    parts: list[str] = []
    table: list[str] = []

    def close() -> None:
        if table:
            parts.append(f'<div class="wide"><table>{"".join(table)}</table></div>')
            table.clear()

    for line in markdown.splitlines():
        if line.startswith("|"):
            cells = [html.escape(cell.strip().strip("`")) for cell in line.strip("|").split("|")]
            if all(set(cell) <= {"-", ":"} and cell for cell in cells):
                continue
            kind = "td" if table else "th"
            table.append("<tr>" + "".join(f"<{kind}>{cell}</{kind}>" for cell in cells) + "</tr>")
            continue
        close()
        if line.startswith("## "):
            parts.append(f"<h2>{html.escape(line[3:])}</h2>")
        elif line:
            parts.append(f"<p>{html.escape(line)}</p>")
    close()
    return "\n".join(parts)
