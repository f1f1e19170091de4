"""Rows, intervals, the paper's numbers beside ours, and what counts as worse."""

import json
import math

import pytest

from humanmm.errors import InputError
from humanmm.models.benchmark.scores import CutError, Figure, MethodFigures, VideoFigures
from humanmm.models.benchmark.tables.layout import note_on_ate, tables_of
from humanmm.models.benchmark.tables.regression import regressions
from humanmm.models.benchmark.tables.rows import ALL, Row, rows_of, summarise
from humanmm.storage.pages.bench_report import as_json


def video(split: str, wa: float, *, failure: str = "", angle: float = 90.0) -> VideoFigures:
    figures = () if failure else (Figure("wa_mpjpe100_mm", wa), Figure("coverage", 1.0))
    cuts = () if failure else (CutError(angle, wa / 10),)
    return VideoFigures("v", split, (MethodFigures("humanmm", figures, cuts, failure),))


VIDEOS = [
    video("2 transitions", 80.0),
    video("2 transitions", 120.0, angle=180.0),
    video("2 transitions", 0.0, failure="no usable person"),
    video("3 transitions", 200.0, angle=10.0),
]


def test_failures_are_in_the_denominator_and_not_in_the_means() -> None:
    two = rows_of(VIDEOS)[0]
    assert (two.split, two.n, two.failed) == ("2 transitions", 3, 1)
    assert two.metrics["wa_mpjpe100_mm"].mean == 100.0


def test_all_splits_together_are_a_row_and_cuts_are_grouped_by_angle() -> None:
    whole = rows_of(VIDEOS)[-1]
    assert (whole.split, whole.n) == (ALL, 4)
    assert whole.metrics["cam_cut_rot_deg_at_60_120"].mean == 8.0
    assert whole.metrics["cam_cut_rot_deg_at_150_180"].mean == 12.0
    assert whole.metrics["cam_cut_rot_deg_at_0_60"].mean == 20.0
    assert "cam_cut_rot_deg_at_120_150" not in whole.metrics


def test_the_papers_numbers_stand_beside_ours_and_are_marked() -> None:
    two, *_ = tables_of(rows_of(VIDEOS), paper="ms-AIST")
    assert two.title == "2 transitions, n = 3"
    column = two.head.index("paper: HumanMM, ms-AIST (other data)")
    assert {row[0]: row[column] for row in two.rows}["wa_mpjpe100_mm"] == "121.35"


def test_lines_are_figures_or_methods_and_the_cells_are_the_same() -> None:
    by_figure, by_method = (tables_of(rows_of(VIDEOS), paper="none", lines=way)[-1] for way in ("figures", "methods"))
    grid = [by_figure.head, *by_figure.rows]
    assert [by_method.head, *by_method.rows] == [tuple(column) for column in zip(*grid, strict=True)]


def stored(rows: list[Row]) -> dict[str, object]:
    tree = json.loads(as_json("ms-mocap", "humanmm bench ms-mocap", rows))
    assert isinstance(tree, dict)
    return tree


def row(mean: float, *, failed: int = 0, coverage: float = 0.9) -> Row:
    samples = [mean - 10.0, mean, mean + 10.0]
    shares = [coverage - 0.05, coverage, coverage + 0.05]
    return Row("humanmm", "all", 3, failed, {"wa_mpjpe100_mm": summarise(samples), "coverage": summarise(shares)})


def test_the_same_table_is_no_regression_and_neither_is_a_better_one() -> None:
    old = stored([row(100 / 3)])
    assert regressions([row(100 / 3)], old, table="ms-mocap") == []
    assert regressions([row(10.0, coverage=0.94)], old, table="ms-mocap") == []


def test_a_mean_beyond_the_interval_is_a_regression_in_the_direction_that_is_bad() -> None:
    old = stored([row(100.0)])
    assert len(regressions([row(115.0)], old, table="ms-mocap")) == 1
    assert len(regressions([row(100.0, coverage=0.5)], old, table="ms-mocap")) == 1
    assert len(regressions([row(100.0, failed=1)], old, table="ms-mocap")) == 1


def test_another_table_cannot_be_compared() -> None:
    with pytest.raises(InputError, match="not of speed"):
        regressions([row(1.0)], stored([row(1.0)]), table="speed")
    with pytest.raises(InputError, match=r"results\.json"):
        regressions([row(1.0)], {"rows": []}, table="ms-mocap")


def test_a_bootstrap_interval_holds_the_mean() -> None:
    metric = summarise([1.0, 2.0, 3.0, 10.0])
    assert metric.ci95[0] < metric.mean < metric.ci95[1]
    assert math.isclose(metric.median, 2.5)


def test_videos_whose_cameras_stand_in_two_places_have_a_note() -> None:
    (table,) = note_on_ate(2, 5)
    assert table.rows[0][0] == "cam_ate_m" and table.rows[0][1].startswith("of 2 of 5 videos it says nothing")
    assert note_on_ate(0, 5) == []
