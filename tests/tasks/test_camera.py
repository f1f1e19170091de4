"""Stage `camera`: a shot's camera from its points, or static where the user says so."""

from typing import Any

import numpy as np
from filmed_points import make_scene
from held_results import inputs_of

from humanmm.models.geometry.rotations import rotation_angle
from humanmm.models.records.camera import ShotCamera
from humanmm.models.records.shots import Scenes, Shot, ShotList
from humanmm.models.records.tracks import ScenePeople
from humanmm.tasks.camera import camera

N = 40
PAN = make_scene("pan", num_frames=N, num_points=200)


def _estimated(corrections: tuple[dict[str, Any], ...] = (), **settings: Any) -> ShotCamera:
    results = {
        "scenes": Scenes(N, ()),
        "shots": ShotList(N, (Shot(0, 0, N, 0, None, ()),), ()),
        "people": [ScenePeople(0, N, ())],
        "points": [PAN.points],
        "intrinsics": PAN.intrinsics,
    }
    return camera(inputs_of("camera", results, camera=settings, corrections=list(corrections)))


def test_a_camera_that_pans_is_found_to_pan_as_it_did() -> None:
    found = _estimated()
    assert found.source == "rotation_only"
    error = rotation_angle(np.swapaxes(found.R_shot_cam, -1, -2) @ PAN.R_shot_cam)
    assert np.degrees(error).max() < 0.5


def test_a_camera_is_static_if_the_setting_or_a_correction_of_its_shot_says_so() -> None:
    corrected = ({"kind": "static-shot", "frame": 3},)
    for found in (_estimated(static=True), _estimated(corrected)):
        assert found.source == "given"
        np.testing.assert_array_equal(found.R_shot_cam, np.tile(np.eye(3), (N, 1, 1)))
    assert _estimated(({"kind": "static-shot", "frame": N},)).source == "rotation_only", "of another shot"
