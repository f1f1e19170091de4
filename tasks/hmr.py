"""Body pose, shape, orientation and position of everybody in one shot, in camera axes."""

from humanmm.errors import StageError
from humanmm.models.motion.fit.hmr import NoiseModel, fit_shot
from humanmm.models.records.camera import ShotCamera
from humanmm.models.records.motion import ShotMotion
from humanmm.models.records.shots import ShotList
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.parts import load
from humanmm.tasks.inputs import StageInputs


def hmr(inputs: StageInputs) -> ShotMotion:
    """The fitted motion of the shot's people."""
    if inputs.shot is None:
        raise StageError("hmr works shot by shot, but was given no shot")
    shots = inputs.read("shots", ShotList)
    settings = inputs.config.hmr
    return fit_shot(
        inputs.read("people", ScenePeople),
        inputs.shot,
        shots.people,
        inputs.read("decode", VideoFacts).time_s,
        inputs.read("camera", ShotCamera),
        noise=NoiseModel(prior=settings.pose_prior, smoothness=settings.smoothness),
        initial_pose=load("hmr.initial_pose", settings.initial_pose),
        progress=inputs.progress,
    )
