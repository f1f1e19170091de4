"""The golden set's tables: how many expectations hold, and which do not."""

import math

from humanmm.models.benchmark.golden import Verdict
from humanmm.models.benchmark.tables.golden import CheckedClip, all_verdicts, golden_tables, rows_of_golden

CLIPS = (
    CheckedClip(
        "lawn",
        "done",
        (
            Verdict("found", "man", "in 90%", "in 100% of 9 frames", 0.0, True),
            Verdict("elsewhere", "", "no other body", "number 1 in 5 of frames 0-8", 0.5, False),
        ),
    ),
    CheckedClip("bags", "refused", (Verdict("found", "boy", "in 90%", "refused", math.nan, False),)),
)


def test_a_row_is_a_clip_with_its_expectations_and_how_many_fail() -> None:
    rows = {row.split: row for row in rows_of_golden(CLIPS)}
    assert (rows["lawn"].n, rows["lawn"].failed) == (2, 1)
    assert rows["lawn"].metrics["elsewhere"].mean == 0.5
    assert not rows["bags"].metrics  # what cannot be measured has no figure
    assert (rows["all"].n, rows["all"].failed) == (3, 2)
    assert rows["all"].metrics["failed found"].mean == 1.0


def test_tables_have_every_clip_and_every_failure() -> None:
    summary, failures = golden_tables(CLIPS)
    assert summary.title == "1 of 3 expectations hold"
    assert summary.head == ("clip", "run", "found", "elsewhere")
    assert summary.rows == (
        ("lawn", "done", "1", "0 of 1"),
        ("bags", "refused", "0 of 1", ""),
        ("all 2 clips", "0 whole", "1 of 2", "0 of 1"),
    )
    assert [row[:2] for row in failures.rows] == [("lawn", "elsewhere"), ("bags", "found")]
    assert [row[:3] for row in all_verdicts(CLIPS).rows] == [("lawn", "found", "man")]
