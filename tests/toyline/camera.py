"""A static camera."""

import numpy as np

from humanmm.models.geometry.intrinsics import K_of
from humanmm.models.records.camera import Intrinsics, PointTracks, ShotCamera
from humanmm.models.records.shots import ShotList
from humanmm.models.records.tracks import ScenePeople
from humanmm.tasks.inputs import StageInputs
from toyline.behaviour import act, filled


def camera(inputs: StageInputs) -> ShotCamera:
    act("camera", inputs)
    start, end = inputs.span
    n = end - start
    assert inputs.shot is not None
    assert len(inputs.read("shots", ShotList).shots) == 1
    assert len(inputs.read("points", PointTracks).frame) >= n
    inputs.read("people", ScenePeople)
    K = K_of(inputs.read("intrinsics", Intrinsics))
    static = inputs.config.camera.static or inputs.corrections.correction
    moves = np.zeros((n, 3)) if static else np.cumsum(np.ones((n, 3)), 0)
    return filled(
        ShotCamera, n, start=start, end=end, t_shot_cam=moves, K=np.tile(K, (n, 1, 1)), source="static",
        warnings=("it does not move",),
    )  # fmt: skip
