"""The report's page stands alone and says nothing that it was not given."""

import re
from dataclasses import replace

import numpy as np

from humanmm.models.benchmark.tables.charts import Chart, Curves
from humanmm.models.benchmark.tables.drawings import Case, Drawing
from humanmm.models.benchmark.tables.rows import summarise
from humanmm.models.drawing.figure import CSS_DPI, new_figure
from humanmm.models.records.table import Code, Table
from humanmm.storage.pages.bench_page import Page, as_html


def _drawing() -> Drawing:
    figure = new_figure(100, 50, dpi=CSS_DPI)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    axes.plot([0.1, 0.9, np.nan, 0.2, 0.3], [0.2, 0.4, np.nan, 0.1, 0.2])
    return Drawing("from above, 1.0 m wide", figure)


PAGE = Page(
    title="ms-<mocap>",
    created_by="humanmm bench",
    facts="2 videos.",
    tables=[Table(("", "humanmm"), ((Code("roe_deg"), "12 [8, 16]"),), "all, n = 2")],
    methods=("humanmm", "concat"),
    charts=(Chart("ROE", ("all",), (("<humanmm>", (summarise([3.0, 5.0]),)), ("concat", (None,)))),),
    curves=(Curves("Error", "seconds", (-1.0, 0.0, 1.0), (("humanmm", (None, 3.0, 4.0)),)),),
    typical=(Case("walk", "2 transitions", "WA-MPJPE 80 mm", (_drawing(),), (), "overlays/walk.mp4"),),
    worst=(Case("<run>", "2 transitions", "failed: nobody"),),
)


def test_nothing_is_loaded_from_elsewhere_and_text_is_no_markup() -> None:
    text = as_html(PAGE)
    assert not re.search(r"<(script|link|img|iframe)|https?://", text)
    assert "ms-&lt;mocap&gt;" in text
    assert "&lt;run&gt;" in text
    assert "nan" not in text


def test_the_table_the_curve_and_the_link_to_the_overlay_are_there() -> None:
    text = as_html(PAGE)
    assert "<tr><td>roe_deg</td><td>12 [8, 16]</td></tr>" in text
    assert text.count("<svg") == 3  # a chart, curves, a drawing
    assert 'href="overlays/walk.mp4"' in text
    assert "The worst 1" in text


def test_bars_have_tooltips_with_names_escaped_and_a_missing_value_has_no_bar() -> None:
    assert re.findall("<title>(.*?)</title>", as_html(PAGE))[1:] == ["&lt;humanmm&gt;, all: 4", "humanmm"]


def test_every_reference_has_its_target_and_elements_of_one_id_are_the_same() -> None:
    text = as_html(PAGE)
    ids = set(re.findall(' id="([^"]*)"', text))
    assert all(len(set(re.findall(f'<[^>]* id="{name}".{{80}}', text, re.S))) == 1 for name in ids)
    assert set(re.findall(r"url\(#([^)]*)\)", text)) | set(re.findall('href="#([^"]*)"', text)) == ids


def test_the_same_page_is_the_same_bytes() -> None:
    assert as_html(replace(PAGE, typical=(), worst=())) == as_html(replace(PAGE, typical=(), worst=()))
