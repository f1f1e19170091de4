"""The table of joints: what is wrong, what of it was claimed, and whether stated deviations hold."""

import pytest

from humanmm.models.benchmark.identity import Link, PairFigures
from humanmm.models.benchmark.scores import CutError, Figure, MethodFigures, VideoFigures
from humanmm.models.benchmark.tables.cuts import PUBLISHED, cut_tables, identity_rows, identity_tables
from humanmm.models.benchmark.tables.groups import ClipLabels


def video(name: str, cuts: list[CutError], *, failure: str = "") -> VideoFigures:
    figures = () if failure else (Figure("cut_jump_m", 0.1), Figure("idf1", 0.5), Figure("coverage", 1.0))
    return VideoFigures(name, "1 transition", (MethodFigures("humanmm", figures, tuple(cuts), failure),))


def cut(error: float | None, stated: float | None = None, probability: float | None = None) -> CutError:
    most = None if stated is None else 20 * stated
    return CutError(100.0, error, stated_deg=stated, stated_95_deg=most, probability=probability)


def test_wrong_cuts_are_counted_and_those_that_were_claimed() -> None:
    cuts = [cut(4.0, 5.0, 0.9), cut(9.0, 5.0, 0.9), cut(90.0, 3.0, 0.95), cut(170.0, 90.0, 0.4), cut(None)]
    table, published = cut_tables([video("a", cuts)], {})
    (line,) = table.rows
    assert line[:6] == ("humanmm", "5", "49.5 / 68.2 / 146.0", "3 (60 %)", "1", "25 % / 75 % / 75 %")
    assert line[6:] == ("", "0.10 / 0.10", "", "0.50", "1.00", "0")
    assert len(published.rows) == len(PUBLISHED) and "other sequences" in published.head[0]


def test_splits_are_apart_and_failures_are_no_coverage() -> None:
    labels = {"a": ClipLabels("dev"), "b": ClipLabels("test"), "c": ClipLabels("test")}
    videos = [video("a", [cut(1.0)]), video("b", [cut(2.0)]), video("c", [], failure="nobody")]
    dev, test, _ = cut_tables(videos, labels)
    assert dev.title.endswith("dev, n = 1") and test.title.endswith("test, n = 2")
    assert dev.rows[0][-2:] == ("1.00", "0") and test.rows[0][-2:] == ("0.50", "1")


def test_a_method_without_any_cut_has_an_empty_line() -> None:
    line = cut_tables([video("a", [])], {})[0].rows[0]
    assert line[:6] == ("humanmm", "0", "", "", "0", "")


def test_links_are_counted_by_kind_of_pair_and_by_probability() -> None:
    figures = [
        PairFigures(False, 2, (Link(0.99, True),)),
        PairFigures(False, 0, (Link(0.6, False),)),
        PairFigures(True, 0, (Link(0.95, False), Link(0.8, True))),
    ]
    rows = {row.split: row for row in identity_rows(figures)}
    assert rows["all"].n == 3
    assert rows["all"].metrics["link_precision"].mean == pytest.approx(0.5)
    assert rows["of one recording"].metrics["link_recall"].mean == 0.5
    table, calibration = identity_tables(figures)
    assert table.rows[0] == ("all", "3", "2", "4", "0.500", "1.000", "1")
    assert [row[1] for row in calibration.rows] == ["0", "1", "1", "1", "1"]
    assert calibration.rows[-1][2:] == ("0.990", "1.000")
