"""The table of doubts counts what is wrong with and without a warning."""

from humanmm.models.benchmark.tables.doubts import doubts_table, rows_of_doubts
from humanmm.models.evaluation.doubts import CLIP, KINDS, Judgement

FACINGS = [Judgement("facing", *one) for one in [(True, True), (True, False), (False, True)] + [(False, False)] * 7]


def test_a_line_says_how_often_a_warning_and_silence_were_right() -> None:
    table = doubts_table(FACINGS)
    assert table.rows[0] == (KINDS["facing"], "10", "2", "2", "1 (50 %)", "8", "1 (12 %)")
    assert table.rows[1][1:] == ("0", "0", "0", "0", "0", "0")


def test_rows_hold_the_same_as_shares() -> None:
    rows = {row.split: row for row in rows_of_doubts([*FACINGS, Judgement(CLIP, True, True)], failed=2)}
    facing = {name: metric.mean for name, metric in rows["facing"].metrics.items()}
    assert facing == {"wrong": 0.2, "warned": 0.2, "wrong_without_warning": 0.125}
    assert (rows["facing"].n, rows["facing"].failed) == (10, 0)
    assert (rows[CLIP].n, rows[CLIP].failed) == (1, 2)
    assert "wrong_without_warning" not in rows[CLIP].metrics
