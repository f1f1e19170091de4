"""Stage `camera`: the camera of one shot."""

from humanmm.models.camera.estimate import estimate_camera
from humanmm.models.camera.masking import without_transitions
from humanmm.models.camera.observations import Intrinsics, PointTracks, ShotCamera
from humanmm.models.camera.parts import within
from humanmm.models.perception.tracks import ScenePeople
from humanmm.models.shots.boundaries import ShotList
from humanmm.tasks.inputs import StageInputs


def camera(inputs: StageInputs) -> ShotCamera:
    """Standing, turning or moving camera from the points that lie on nobody."""
    transitions = [shot.transition for shot in inputs.read("shots", ShotList).shots]
    return estimate_camera(
        without_transitions(within(inputs.read("points", PointTracks), *inputs.span), transitions),
        inputs.read("people", ScenePeople).tracks,
        inputs.read("intrinsics", Intrinsics),
        static=inputs.config.camera.static,
    )
