"""Errors of landmarks by lifter, over all frames of all tracks."""

import numpy as np
import pytest

from humanmm.models.benchmark.tables.lifting import lifting_rows, lifting_table
from humanmm.models.evaluation.landmarks import LandmarkErrors

LIFTERS = {
    "pose network": [LandmarkErrors(*(np.full(3, 80.0) for _ in range(4)))],
    "lifter": [LandmarkErrors(*(np.full(n, mm) for _ in range(4))) for n, mm in ((3, 40.0), (1, 80.0))],
    "keypoint lifter": [],
}


def test_a_row_has_the_median_and_the_mean_of_all_frames() -> None:
    rows = {row.method: row for row in lifting_rows(LIFTERS, failed=1)}
    assert (rows["lifter"].n, rows["lifter"].failed) == (3, 1)
    figure = rows["lifter"].metrics["pa_mpjpe_mm"]
    assert (figure.median, figure.mean) == (40.0, pytest.approx(50.0))
    assert not rows["keypoint lifter"].metrics


def test_the_table_says_how_many_frames_count() -> None:
    lines = {line[0]: line[1:] for line in lifting_table(LIFTERS).rows}
    assert lines["lifter"] == ("2", "4", *["40.0, 50.0"] * 4)
    assert lines["keypoint lifter"] == ("0", "0", "", "", "", "")
