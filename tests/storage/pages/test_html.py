"""Pages: every value is escaped, a figure gives equal bytes and no reference to anything outside."""

import matplotlib.pyplot as plt
import pytest
from jinja2 import UndefinedError
from matplotlib.figure import Figure

from humanmm.models.drawing.figure import TOOLTIP
from humanmm.storage.pages.html import fill, svg_of


def figure() -> Figure:
    drawn, axes = plt.subplots(figsize=(2, 1))
    (line,) = axes.plot([0, 1], [0, 1])
    line.set_gid(f"{TOOLTIP}3 of 4")
    axes.set_title("a < b")
    plt.close(drawn)
    return drawn


def test_a_figure_is_the_same_element_every_time_with_tooltips_and_text() -> None:
    element = svg_of(figure())
    assert element == svg_of(figure())
    assert element.startswith("<svg") and "xmlns" not in element and '<g id="' not in element
    assert "<title>3 of 4</title>" in element and "a &lt; b" in element


def test_a_template_gets_all_its_values() -> None:
    with pytest.raises(UndefinedError):
        fill("bench.html")
