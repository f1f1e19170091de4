"""The report's page stands alone and says nothing that it was not given."""

import re

import numpy as np

from humanmm.models.benchmark.tables.drawings import TRUTH, Case, Curves, Drawing, Stroke
from humanmm.storage.pages.bench_page import Page, as_html

LINE = np.array([[0.1, 0.2], [0.9, 0.4]])
DRAWING = Drawing("from above, 1.0 m wide", 1.0, 0.5, (Stroke(TRUTH, True, LINE), Stroke(0, False, LINE)))
PAGE = Page(
    title="ms-<mocap>",
    created_by="humanmm bench",
    facts="2 videos.",
    table="## all, n = 2\n\n| | humanmm |\n|---|---:|\n| `roe_deg` | 12 [8, 16] |\n",
    methods=("humanmm", "concat"),
    curves=(Curves("Error", "seconds", (-1.0, 0.0, 1.0), (("humanmm", (None, 3.0, 4.0)),)),),
    typical=(Case("walk", "2 transitions", "WA-MPJPE 80 mm", (DRAWING,), "overlays/walk.mp4"),),
    worst=(Case("<run>", "2 transitions", "failed: nobody", ()),),
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
    assert text.count("<polyline") == 3  # one curve, two strokes
    assert 'href="overlays/walk.mp4"' in text
    assert "The worst 1" in text
