"""Stage `shots`: cuts that people show, who is who across the cuts, and where left and right are swapped."""

from humanmm.models.records.shots import Scenes, ShotList
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.models.shots.assemble import detect_shots
from humanmm.tasks.inputs import StageInputs


def shots(inputs: StageInputs) -> ShotList:
    """Final shots and the people in them."""
    settings = inputs.config.shots
    return detect_shots(
        inputs.read("decode", VideoFacts),
        inputs.read("scenes", Scenes),
        inputs.read_all("people", ScenePeople),
        only_person=settings.person,
        parts=settings.parts,
        min_confidence=settings.min_confidence,
        need_people=settings.need_people,
        corrections=inputs.corrections,
    )
