"""Body pose, shape, orientation and position of everybody in one shot, in camera axes."""

from humanmm.errors import StageError
from humanmm.models.camera.observations import ShotCamera
from humanmm.models.motion.hmr import NoiseModel, fit_shot
from humanmm.models.motion.results import ShotMotion
from humanmm.models.perception.tracks import ScenePeople
from humanmm.models.shots.boundaries import ShotList
from humanmm.models.video.facts import VideoFacts
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
    )
