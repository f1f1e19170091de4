"""Stage `refine`: one motion over all shots."""

from humanmm.corrections import Floor
from humanmm.models.motion.refine.refine import RefineSettings
from humanmm.models.motion.refine.refine import refine as refine_motion
from humanmm.models.records.motion import WorldMotion
from humanmm.models.records.shots import ShotList
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.tasks.inputs import StageInputs


def refine(inputs: StageInputs) -> WorldMotion:
    """The people of `align`, smoothed, with contacts, planted feet and filled gaps."""
    return refine_motion(
        inputs.read("align", WorldMotion),
        inputs.read("shots", ShotList),
        inputs.read_all("people", ScenePeople),
        time_s=inputs.read("decode", VideoFacts).time_s,
        settings=RefineSettings.chosen(
            inputs.config.refine, floor_m=sum(one.metres for one in inputs.corrections.of(Floor))
        ),
        progress=inputs.progress,
    )
