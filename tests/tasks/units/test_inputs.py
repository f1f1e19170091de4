"""A stage's function gets what its key is made of, and an error for anything else."""

from pathlib import Path
from typing import Any

import pytest

from humanmm.config import Config
from humanmm.errors import StageError
from humanmm.models.records.camera import Intrinsics, ShotCamera
from humanmm.models.records.shots import Scenes, ShotList
from humanmm.tasks.units.inputs import UnitInputs


@pytest.fixture
def finished(toy: Any) -> Any:
    """A whole run of the toy."""
    return toy.run()


def _inputs(run: Any, stage: str, index: int = 0) -> UnitInputs:
    config = Config.model_validate({"corrections": {"correction": [{"kind": "static-shot", "frame": 25}]}})
    unit = run.unit(stage, index)
    return UnitInputs(unit, run, video=run.video, config=config, blob_dir=Path("blobs"), progress=lambda *_: None)


def test_a_shot_has_its_frames_its_corrections_and_itself_alone_in_the_list(finished: Any) -> None:
    second, third = _inputs(finished, "camera", 1), _inputs(finished, "camera", 2)
    assert second.span == (20, 40) and second.shot is not None
    assert [shot.start for shot in second.read("shots", ShotList).shots] == [20]
    assert second.read("intrinsics", Intrinsics).height == 480
    assert len(second.corrections.correction) == 1 and not third.corrections.correction


def test_a_stage_of_the_video_has_all_frames_and_reads_all_shots(finished: Any) -> None:
    inputs = _inputs(finished, "align")
    assert inputs.span == (0, 60) and inputs.shot is None
    del finished.outcomes[("camera", 1)]  # as if it had failed
    assert [camera is None for camera in inputs.read_all("camera", ShotCamera)] == [False, True, False]
    with pytest.raises(StageError, match="align reads camera, which is per shot: use read_all"):
        inputs.read("camera", ShotCamera)


def test_what_the_table_of_stages_does_not_name_is_an_error(finished: Any) -> None:
    camera, people = _inputs(finished, "camera"), _inputs(finished, "people")
    with pytest.raises(StageError, match=r"camera reads align without naming it in pipeline\.STAGES"):
        camera.read("align", ShotCamera)
    with pytest.raises(StageError, match=r"camera uses the settings 'people' without naming them"):
        _ = camera.config.people
    with pytest.raises(StageError, match="camera opens the video without `reads_video`"):
        camera.open_video()
    with people.open_video() as stream:
        assert stream.read(1) == b"{"
    with pytest.raises(StageError, match="people has its scene in `span`"):
        people.read("scenes", Scenes)
