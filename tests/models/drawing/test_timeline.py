"""Timeline: it has room for all people and warnings, and stages add up."""

import dataclasses

import numpy as np

from humanmm.models.drawing import palette
from humanmm.models.drawing.overlay import Mark
from humanmm.models.drawing.timeline import StageTime, stages_title, timeline
from humanmm.models.records.recording import Recording
from humanmm.tasks.pictures import stage_times
from humanmm.tasks.pipeline import STAGES as STAGE_TABLE

STAGES = [StageTime("decode", 0.4, 1, 1, 0), StageTime("people", 3.0, 2, 0, 0)]


def _fraction(image: np.ndarray, color: palette.RGB) -> float:
    return float((image == np.array(color)).all(-1).mean())


def test_the_timeline_grows_with_its_people_and_warnings(standing: Recording) -> None:
    marks = [Mark("cut", 20, 20)]
    plain = timeline(standing, marks, STAGES, [])
    warned = timeline(standing, marks, STAGES, ["something costs $5 and $6", *["a long sentence " * 30] * 20])
    second = dataclasses.replace(standing.people[0], person=1)
    crowded = timeline(dataclasses.replace(standing, people=(*standing.people, second)), marks, STAGES, [])
    assert warned.shape[0] > plain.shape[0] + 50
    assert crowded.shape[0] > plain.shape[0] + 50
    assert _fraction(crowded, palette.person_color(second)) > 0.005


def test_units_of_a_stage_are_added_up() -> None:
    record = {
        "stages": [
            {"stage": "hmr", "unit": "shot 0", "seconds": 1.5, "state": "cached"},
            {"stage": "hmr", "unit": "shot 1", "seconds": 2.0, "state": "failed"},
            {"stage": "align", "unit": "video", "seconds": 0.5, "state": "computed"},
        ]
    }
    assert stage_times(record) == [StageTime("hmr", 3.5, 2, 1, 1), StageTime("align", 0.5, 1, 0, 0)]


def test_the_sum_of_stages_is_not_called_the_time_of_the_run() -> None:
    assert stages_title(STAGES).startswith("seconds in each stage, added up 3.4; stages may run beside others")


def test_no_name_of_a_stage_is_cut_off(standing: Recording) -> None:
    names = [stage.name for stage in STAGE_TABLE]
    image = timeline(standing, [], [StageTime(name, 1.0, 1, 0, 0) for name in names], [])
    assert (image[:, :2] == image[0, 0]).all(), "something is drawn at the very edge"
