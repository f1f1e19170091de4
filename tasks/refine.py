"""Stage `refine`: one motion over all shots."""

from humanmm.models.motion.refine.refine import Observations, RefineSettings, refine_world
from humanmm.models.records.motion import WorldMotion
from humanmm.models.records.shots import ShotList
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.tasks.inputs import StageInputs


def refine(inputs: StageInputs) -> WorldMotion:
    """The people of `align`, smoothed, with contacts, planted feet and filled gaps."""
    config = inputs.config.refine
    shots = inputs.read("shots", ShotList)
    return refine_world(
        inputs.read("align", WorldMotion),
        Observations(shots, inputs.read_all("people", ScenePeople)),
        time_s=inputs.read("decode", VideoFacts).time_s,
        cut_frames=tuple(shot.start for shot in shots.shots[1:]),
        settings=RefineSettings(
            cutoff_hz=config.cutoff_hz,
            close_seams=config.close_seams,
            refit=config.refit,
            foot_lock=config.foot_lock,
        ),
    )
