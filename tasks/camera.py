"""Stage `camera`: the camera of one shot."""

from humanmm.errors import StageError
from humanmm.models.camera.estimate import estimate_camera
from humanmm.models.camera.masking import without_transitions
from humanmm.models.camera.shot_points import within
from humanmm.models.records.camera import Intrinsics, PointTracks, ShotCamera
from humanmm.models.records.tracks import ScenePeople
from humanmm.tasks.inputs import StageInputs


def camera(inputs: StageInputs) -> ShotCamera:
    """Standing, turning or moving camera from the points that lie on nobody."""
    if inputs.shot is None:
        raise StageError("camera works shot by shot, but was given no shot")
    return estimate_camera(
        without_transitions(within(inputs.read("points", PointTracks), *inputs.span), inputs.shot.outside_transitions),
        inputs.read("people", ScenePeople).tracks,
        inputs.read("intrinsics", Intrinsics),
        static=inputs.config.camera.static,
    )
