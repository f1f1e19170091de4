"""Cameras that the user gives become a shot's camera, in the axes of its first frame."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from humanmm.models.camera.focal_length.intrinsics import intrinsics_of_shots
from humanmm.models.camera.given import given_camera
from humanmm.models.camera.shot_camera import estimate_camera
from humanmm.models.records.camera import GivenCameras, Intrinsics
from humanmm.models.records.shots import Shot
from humanmm.models.records.tracks import ScenePeople

N = 60
SHOT = Shot(1, 20, 50, 0, None, ())
WORLD = Rotation.from_euler("zyx", [20, 30, 40], degrees=True).as_matrix()


def _cameras(scene: Any, *, step: int = 1, focal_px: float = np.nan) -> GivenCameras:
    frame = np.arange(0, N, step)
    R, t = WORLD @ scene.R_shot_cam[frame], scene.t_shot_cam[frame] @ WORLD.T * 7 + [1.0, 2.0, 3.0]
    return GivenCameras(frame.astype(np.int32), R, t, np.full(len(frame), focal_px))


def test_a_shots_camera_is_the_given_one_from_its_first_frame_on(scene_of: Callable[..., Any]) -> None:
    scene = scene_of("orbit", num_frames=N)
    camera = given_camera(SHOT, replace(scene.intrinsics, cameras=_cameras(scene)))
    assert camera is not None and camera.source == "given" and not camera.metric and camera.travels
    first = scene.R_shot_cam[20].T
    np.testing.assert_allclose(camera.R_shot_cam, first @ scene.R_shot_cam[20:50], atol=1e-9)
    expected = 7 * (scene.t_shot_cam[20:50] - scene.t_shot_cam[20]) @ first.T
    np.testing.assert_allclose(camera.t_shot_cam, expected, atol=1e-9)
    np.testing.assert_allclose(camera.K[:, 0, 0], scene.intrinsics.focal_px)


def test_frames_that_are_not_given_lie_between_those_that_are(scene_of: Callable[..., Any]) -> None:
    scene = scene_of("pan", num_frames=N)
    camera = given_camera(SHOT, replace(scene.intrinsics, cameras=_cameras(scene, step=4)))
    assert camera is not None and camera.metric and not camera.travels
    np.testing.assert_allclose(camera.R_shot_cam[:29], scene.R_shot_cam[20].T @ scene.R_shot_cam[20:49], atol=1e-6)
    assert camera.warnings == ("the given cameras are of 8 of its 30 frames: interpolated between them",)


def test_a_shot_that_is_not_covered_is_estimated_with_a_warning(scene_of: Callable[..., Any]) -> None:
    scene = scene_of("pan", num_frames=N)
    whole = _cameras(scene)
    few = GivenCameras(whole.frame[:30], whole.R_given_cam[:30], whole.t_given_cam[:30], whole.focal_px[:30])
    intrinsics = replace(scene.intrinsics, cameras=few)
    assert given_camera(SHOT, intrinsics) is None
    camera = estimate_camera(SHOT, scene.points, ScenePeople(0, N, ()), intrinsics)
    assert (
        camera.source == "rotation_only" and "the given cameras do not cover it (frames 20 to 49)" in camera.warnings[0]
    )
    covered = estimate_camera(Shot(0, 0, 30, 0, None, ()), scene.points, ScenePeople(0, N, ()), intrinsics)
    assert covered.source == "given"


def test_a_given_focal_length_is_every_shots_unless_the_user_says_another(scene_of: Callable[..., Any]) -> None:
    scene = scene_of("pan", num_frames=N)
    cameras = replace(_cameras(scene), focal_px=np.linspace(1000, 1200, N))
    facts: Any = type("Facts", (), {"width": 960, "height": 540})

    def found(**more: float) -> Intrinsics:
        return intrinsics_of_shots(facts, [], [], cameras=cameras, **more)

    assert found().focal_px == 1100 and found().source == "given" and found().cameras is cameras
    zooming = given_camera(SHOT, found())
    assert zooming is not None and zooming.zooms
    np.testing.assert_allclose(zooming.K[:, 1, 1], cameras.focal_px[20:50])
    fixed = given_camera(SHOT, found(focal_px=800.0))
    assert fixed is not None and not fixed.zooms and fixed.K[0, 0, 0] == 800


def test_given_cameras_that_do_not_fit_the_background_are_not_believed_silently(scene_of: Callable[..., Any]) -> None:
    for kind in ("orbit", "pan"):
        scene = scene_of(kind, num_frames=N)
        given = _cameras(scene)
        inverse = GivenCameras(
            given.frame, given.R_given_cam.transpose(0, 2, 1),
            -np.einsum("nba,nb->na", given.R_given_cam, given.t_given_cam), given.focal_px,
        )  # fmt: skip
        stills = replace(given, R_given_cam=np.tile(WORLD, (N, 1, 1)), t_given_cam=np.zeros((N, 3)))
        right, inverted, still = (
            estimate_camera(
                Shot(0, 0, N, 0, None, ()), scene.points, ScenePeople(0, N, ()), replace(scene.intrinsics, cameras=one)
            )
            for one in (given, inverse, stills)
        )
        assert right.source == "given" and right.warnings == () and right.reprojection_px < 1.0
        (said,) = inverted.warnings
        assert "their inverse 0." in said and "camera to world is expected" in said
        (said,) = still.warnings
        assert "are they of this video" in said and still.reprojection_px > 5 * right.reprojection_px
