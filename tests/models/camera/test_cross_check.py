"""pycolmap agrees with a camera that is right, and disagrees with one that is not."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from humanmm.models.camera import cross_check as crosscheck
from humanmm.models.camera.cross_check import cross_check, warnings_of
from humanmm.models.camera.odometry.bundle import Freedom
from humanmm.models.camera.odometry.keyframe_odometry import Track, moving, rotating
from humanmm.models.camera.odometry.tracked_shot import TrackedShot, arrange, choose_keyframes
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.records.camera import CrossCheck


def followed(scene: Any) -> tuple[TrackedShot, Track]:
    """The shot and the moving camera found in it."""
    shot = arrange(scene.points, scene.intrinsics.width, scene.intrinsics.height)
    guide = rotating(shot, choose_keyframes(shot), scene.intrinsics.focal_px, freedom=Freedom(translation=False))
    track = moving(shot, guide)
    assert track is not None
    return shot, track


@pytest.mark.parametrize("kind", ["dolly", "orbit"])
def test_both_adjustments_find_the_same_camera(scene_of: Callable[..., Any], kind: str) -> None:
    check = cross_check(*followed(scene_of(kind)), translating=True)
    assert check.two_view_deg < 0.3
    assert check.bundle_deg < 0.3  # 0.3 px of noise is 0.02 degrees a point
    assert check.bundle_travel < 0.05
    assert not warnings_of(check)


def test_a_camera_that_was_bent_is_bent_back_and_reported(scene_of: Callable[..., Any]) -> None:
    shot, track = followed(scene_of("dolly"))
    count = len(track.keyframes)
    bend = np.linspace(0.0, 1.0, count) ** 2
    R = track.views.R_shot_cam @ rotvec_to_rotmat(bend[:, None] * np.radians([0.0, 4.0, 0.0]))
    extent = np.linalg.norm(track.views.t_shot_cam, axis=1).max()
    t = track.views.t_shot_cam + bend[:, None] * [0.0, 0.6 * extent, 0.0]
    bent = replace(track, views=replace(track.views, R_shot_cam=R, t_shot_cam=t))
    check = cross_check(shot, bent, translating=True)
    assert check.bundle_deg == pytest.approx(4.0, abs=0.5)
    assert check.bundle_travel > 0.1
    assert "bundle adjustment moves the camera by" in " ".join(warnings_of(check))


def test_a_long_shot_is_checked_in_stretches_and_repeatably(
    scene_of: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(crosscheck, "MAX_STRETCH", 6)
    shot, track = followed(scene_of("orbit"))
    assert len(track.keyframes) > 6
    first, second = (cross_check(shot, track, translating=True) for _ in range(2))
    assert first == second
    assert first.bundle_deg < 0.3


def test_a_rotating_camera_is_checked_by_homographies_alone(scene_of: Callable[..., Any]) -> None:
    scene = scene_of("pan")
    shot = arrange(scene.points, scene.intrinsics.width, scene.intrinsics.height)
    track = rotating(shot, choose_keyframes(shot), scene.intrinsics.focal_px, freedom=Freedom(translation=False))
    check = cross_check(shot, track, translating=False)
    assert check.two_view_deg < 0.3
    assert np.isnan(check.bundle_deg) and np.isnan(check.bundle_travel)


def test_no_answer_is_no_warning() -> None:
    assert warnings_of(CrossCheck()) == ()
