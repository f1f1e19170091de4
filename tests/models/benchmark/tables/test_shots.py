"""The table of shot detection: pooled and per-video figures, failures in the denominator."""

import numpy as np
import pytest

from humanmm.models.benchmark.tables.shots import DETECTORS, CutCounts, count_cuts, rows_of_cuts
from humanmm.models.records.shots import Scenes, Transition

SCENES = Scenes(100, (Transition("cut", 40, 40, "scene"), Transition("cut", 80, 80, "scene")))


def test_without_people_every_detector_is_the_one_of_the_colours() -> None:
    counts = count_cuts(SCENES, [], [(41, 41), (60, 60)], time_s=np.arange(100) / 25)
    assert set(counts) == set(DETECTORS)
    assert all(count == CutCounts(2, 2, 1) for count in counts.values())
    assert counts["humanmm"].figures == (0.5, 0.5, 0.5)


def test_pooled_figures_weigh_cuts_and_means_weigh_videos() -> None:
    videos = [CutCounts(9, 9, 9), CutCounts(1, 1, 0), CutCounts(0, 0, 0), None]
    row = rows_of_cuts("all", [None if one is None else dict.fromkeys(DETECTORS, one) for one in videos])[-1]
    assert (row.method, row.n, row.failed) == ("humanmm", 4, 1)
    assert row.metrics["cut_f1"].mean == pytest.approx(2 / 3)
    assert row.metrics["pooled_cut_f1"].mean == pytest.approx(0.9)
    assert (row.metrics["false_cuts"].mean, row.metrics["missed_cuts"].mean) == pytest.approx((1 / 3, 1 / 3))
