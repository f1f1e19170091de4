"""Stage `shots`: cuts that people show, who is who across the cuts, and where the detector swapped left and right."""

from humanmm.models.camera.intrinsics import estimate_intrinsics
from humanmm.models.records.shots import Scenes, ShotList
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.models.shots.assemble import assemble_shots
from humanmm.tasks.inputs import StageInputs


def shots(inputs: StageInputs) -> ShotList:
    """Final shots and the people in them. The focal length is not known yet; the default is near enough here."""
    facts = inputs.read("decode", VideoFacts)
    return assemble_shots(
        inputs.read("scenes", Scenes),
        inputs.read_all("people", ScenePeople),
        time_s=facts.time_s,
        K=estimate_intrinsics([], facts.width, facts.height).K,
        only_person=inputs.config.shots.person,
        parts=inputs.config.shots.parts,
    )
