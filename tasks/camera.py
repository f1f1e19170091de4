"""Stage `camera`: the camera of one shot."""

from humanmm.models.camera.estimate import estimate_camera
from humanmm.models.camera.observations import Intrinsics, PointTracks, ShotCamera
from humanmm.models.perception.tracks import ScenePeople
from humanmm.tasks.inputs import StageInputs


def camera(inputs: StageInputs) -> ShotCamera:
    """Standing, turning or moving camera from the points that lie on nobody."""
    return estimate_camera(
        inputs.read("points", PointTracks),
        inputs.read("people", ScenePeople).tracks,
        inputs.read("intrinsics", Intrinsics),
        static=inputs.config.camera.static,
    )
