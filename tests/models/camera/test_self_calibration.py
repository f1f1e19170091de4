"""The focal length of a camera track from its own points."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from humanmm.models.camera.odometry.bundle import Freedom, residuals
from humanmm.models.camera.odometry.keyframe_odometry import Track, rotating
from humanmm.models.camera.odometry.tracked_shot import arrange, choose_keyframes
from humanmm.models.camera.self_calibration import with_focal, with_own_focal

ROTATION = Freedom(translation=False)


def track_of(scene: Any, focal_px: float) -> Track:
    shot = arrange(scene.points, scene.intrinsics.width, scene.intrinsics.height)
    return rotating(shot, choose_keyframes(shot), focal_px, freedom=ROTATION)


@pytest.mark.parametrize("guess", [0.8, 1.3])
def test_a_pan_tells_its_focal_length_from_a_wrong_guess(scene_of: Callable[..., Any], guess: float) -> None:
    scene = scene_of("pan", num_frames=30, num_points=150)
    found = with_own_focal(track_of(scene, guess * scene.intrinsics.focal_px), ROTATION)
    error = np.log(found.track.views.focal_px / scene.intrinsics.focal_px)
    assert abs(error) < 0.01
    assert abs(error) < 4 * found.log_focal_sigma


def test_another_focal_length_with_the_motion_to_match_shows_nearly_the_same_pixels(
    scene_of: Callable[..., Any],
) -> None:
    track = track_of(scene_of("pan", num_frames=30, num_points=150, noise_px=0.0, outliers=0.0), 900.0)
    before = residuals(track.views, track.points, track.observations)
    views, points = with_focal(track.views, track.points, track.observations, 1.02)
    carried = residuals(views, points, track.observations)
    plainly = residuals(
        type(views)(track.views.R_shot_cam, track.views.t_shot_cam, track.views.log_zoom, views.focal_px),
        track.points, track.observations,
    )  # fmt: skip
    assert np.median(before) < 0.1
    assert np.median(carried) < 0.2 * np.median(plainly)
    same, _ = with_focal(track.views, track.points, track.observations, 1.0)
    np.testing.assert_allclose(same.R_shot_cam, track.views.R_shot_cam, atol=1e-9)
