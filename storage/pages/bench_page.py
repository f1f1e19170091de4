"""A benchmark's report as one HTML page: tables, charts, drawings; nothing is loaded from elsewhere."""

from collections.abc import Sequence
from dataclasses import dataclass

from humanmm.models.benchmark.tables.charts import Chart, Curves, chart_figure, curves_figure, legend
from humanmm.models.benchmark.tables.drawings import Case, drawn_methods
from humanmm.models.records.table import Table
from humanmm.storage.pages.html import fill, svg_of


@dataclass(frozen=True)
class Page:
    """What a report shows. Texts are plain: the writers escape them."""

    title: str
    created_by: str
    facts: str
    tables: Sequence[Table]
    methods: Sequence[str] = ()
    charts: Sequence[Chart] = ()
    curves: Sequence[Curves] = ()
    typical: Sequence[Case] = ()
    worst: Sequence[Case] = ()


def as_html(page: Page) -> str:
    """The text of index.html; the same page for the same content."""
    return fill(
        "bench.html", page=page, svg=svg_of, chart_figure=chart_figure, curves_figure=curves_figure, legend_of=legend,
        drawn=drawn_methods(page.methods),
    )  # fmt: skip
