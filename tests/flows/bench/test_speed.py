"""Arithmetic of the speed table."""

import pytest

from humanmm.errors import StageError
from humanmm.flows.bench.speed import Floor, Speed, stage_milliseconds, stages_wall_s

RECORD = {
    "stages": [
        {"stage": "decode", "began": 100.0, "seconds": 1.0, "state": "computed"},
        {"stage": "people", "began": 101.0, "seconds": 4.0, "state": "computed"},
        {"stage": "people", "began": 101.5, "seconds": 5.0, "state": "computed"},
        {"stage": "shots", "began": None, "seconds": 0.0, "state": "computed"},
    ]
}


def test_units_of_a_stage_are_added_up_a_frame() -> None:
    assert stage_milliseconds(RECORD, 100) == pytest.approx({"decode": 10.0, "people": 90.0, "shots": 0.0})


def test_the_wall_runs_from_the_first_start_to_the_last_end() -> None:
    assert stages_wall_s(RECORD) == pytest.approx(6.5)


def test_a_run_that_computed_nothing_has_no_speed() -> None:
    with pytest.raises(StageError):
        stages_wall_s({"stages": [{"stage": "decode", "began": None, "seconds": 0.0, "state": "computed"}]})


def test_the_ratio_to_the_floor_is_wall_a_frame_over_the_least_a_frame() -> None:
    speed = Speed(100, 4.0, {"decode": 10.0}, 3.0, 4.5, 5.0, 800.0, Floor(3.0, 9.0, 0.5), 2.0)
    metrics = speed.metrics()
    assert metrics["wall_ms_per_frame"] == pytest.approx(30.0)
    assert metrics["ratio_to_floor"] == pytest.approx(2.5)
    assert metrics["ratio_to_duration"] == pytest.approx(0.75)
    assert metrics["overhead_s"] == pytest.approx(1.5)
