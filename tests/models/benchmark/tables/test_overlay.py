"""The overlay's tables: a row a clip, one for all, one for fast frames."""

import numpy as np
import pytest

from humanmm.models.benchmark.tables.overlay import overlay_rows, overlay_tables
from humanmm.models.evaluation.overlay import PersonOverlay


def person(offset_pct: float) -> PersonOverlay:
    """40 frames with the same offset downwards everywhere; in the last two a wrist is fast and it is twice as large."""
    offset = np.zeros((40, 33, 2))
    offset[..., 1] = offset_pct
    offset[38:] *= 2
    return PersonOverlay(0, offset, np.where(np.arange(40) < 38, 0.1, 2.0))


CLIPS = {"slow": [person(1.0)], "two": [person(2.0), person(2.0)]}


def test_rows_have_medians_and_percentiles_of_clips_of_all_and_of_fast_frames() -> None:
    rows = {row.split: row for row in overlay_rows(CLIPS, ["bags"])}
    assert rows["slow"].metrics["median_pct"].mean == pytest.approx(1.0)
    assert rows["slow"].metrics["knees_p95_pct"].mean == pytest.approx(1.05, abs=0.06)
    assert rows["two"].n == 2
    assert rows["all"].metrics["median_pct"].mean == pytest.approx(2.0)
    assert rows["fastest 5 %"].metrics["median_pct"].mean == pytest.approx(4.0)
    assert (rows["bags"].failed, rows["all"].failed) == (1, 1)


def test_tables_have_a_line_a_clip_and_one_a_landmark() -> None:
    table, landmarks = overlay_tables(CLIPS)
    assert [row[0] for row in table.rows] == ["slow", "two", "all", "fastest 5 %"]
    assert table.rows[0][3] == "1.00, 1.0"
    assert ("left_knee", "+0.00", "+2.00") in landmarks.rows
