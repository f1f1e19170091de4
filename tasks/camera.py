"""Stage `camera`: the camera of one shot."""

from humanmm.corrections import StaticShot
from humanmm.errors import StageError
from humanmm.models.camera.shot_camera import estimate_camera
from humanmm.models.records.camera import Intrinsics, PointTracks, ShotCamera
from humanmm.models.records.tracks import ScenePeople
from humanmm.parts import load
from humanmm.tasks.inputs import StageInputs


def camera(inputs: StageInputs) -> ShotCamera:
    """Static, rotating or moving camera from the points that lie on nobody."""
    if inputs.shot is None:
        raise StageError("camera works shot by shot, but was given no shot")
    settings = inputs.config.camera
    return estimate_camera(
        inputs.shot,
        inputs.read("points", PointTracks),
        inputs.read("people", ScenePeople),
        inputs.read("intrinsics", Intrinsics),
        static=settings.static or bool(inputs.corrections.of(StaticShot)),
        estimator=load("camera.estimator", settings.estimator),
        progress=inputs.progress,
    )
