"""Stage `refine`: one motion over all shots."""

from humanmm.corrections import Floor
from humanmm.models.motion.refine.refine import RefineSettings
from humanmm.models.motion.refine.refine import refine as refine_motion
from humanmm.models.records.motion import WorldMotion
from humanmm.models.records.shots import ShotList
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.parts import load
from humanmm.tasks.inputs import StageInputs


def refine(inputs: StageInputs) -> WorldMotion:
    """The people of `align`, smoothed, with contacts, planted feet and filled gaps."""
    config = inputs.config.refine
    return refine_motion(
        inputs.read("align", WorldMotion),
        inputs.read("shots", ShotList),
        inputs.read_all("people", ScenePeople),
        time_s=inputs.read("decode", VideoFacts).time_s,
        settings=RefineSettings(
            cutoff_hz=config.cutoff_hz,
            remove_discontinuities=config.remove_discontinuities,
            refit=config.refit,
            foot_lock=config.foot_lock,
            networks=load("refine.networks", config.networks),
            floor_m=sum(one.metres for one in inputs.corrections.of(Floor)),
        ),
        progress=inputs.progress,
    )
