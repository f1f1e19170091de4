"""Charts hold the figures that they are made of."""

import numpy as np
import pytest
from matplotlib.patches import Rectangle

from humanmm.models.benchmark.tables.charts import Curves, bars_of, chart_figure, charts_of, curves_figure, legend
from humanmm.models.benchmark.tables.rows import Row, angle_key, summarise

ROWS = [
    Row("humanmm", "2 transitions", 2, 0, {"roe_deg": summarise([10.0, 20.0])}),
    Row("concat", "2 transitions", 2, 0, {"roe_deg": summarise([40.0, 60.0])}),
    Row("humanmm", "all", 2, 0, {"roe_deg": summarise([30.0]), angle_key(0, 60): summarise([7.0])}),
]


def test_a_bar_is_as_high_as_its_mean_and_its_line_spans_the_interval() -> None:
    (chart,) = bars_of(ROWS, (("roe_deg", "ROE, degrees"),))
    assert chart.groups == ("2 transitions", "all")
    (axes,) = chart_figure(chart).axes
    bars = [patch for patch in axes.patches if isinstance(patch, Rectangle)]
    assert [bar.get_height() for bar in bars] == [15.0, 30.0, 50.0]
    for bar, line in zip(bars, axes.lines, strict=True):
        low, high = line.get_ydata()
        assert low <= bar.get_height() <= high
        assert line.get_xdata()[0] == pytest.approx(bar.get_x() + bar.get_width() / 2)


def test_bars_of_a_group_stand_side_by_side_within_it() -> None:
    (chart,) = bars_of(ROWS, (("roe_deg", "ROE"),))
    first, _, second = (patch for patch in chart_figure(chart).axes[0].patches if isinstance(patch, Rectangle))
    assert -0.5 < first.get_x() < first.get_x() + first.get_width() < second.get_x() < 0.5


def test_errors_at_cuts_are_grouped_by_the_angle_of_the_cut() -> None:
    by_angle = charts_of(ROWS)[0]
    assert by_angle.groups[0] == "0–60°"
    assert by_angle.series[0][1][0] == ROWS[2].metrics[angle_key(0, 60)]
    assert by_angle.series[1][1] == (None,) * 4


def test_a_curve_is_broken_where_a_value_is_missing() -> None:
    curves = Curves("Error", "seconds", (-1.0, 0.0, 1.0), (("humanmm", (None, 3.0, 4.0)),))
    cut, line = curves_figure(curves).axes[0].lines
    assert cut.get_xdata() == [0, 0]
    np.testing.assert_array_equal(line.get_ydata(), [np.nan, 3.0, 4.0])
    assert legend(curves)[0][0] == "humanmm"
