"""Two views: rotation from directions, parallax, the pose of the second view, and the pair to start from."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from humanmm.models.camera.odometry.tracked_shot import arrange, choose_keyframes
from humanmm.models.camera.odometry.two_view import five_point_pose, parallax_px, rays, starting_pairs, wahba_rotation
from humanmm.models.geometry.rotations import rotation_angle, rotvec_to_rotmat, unit

FOCAL = 900.0
POINTS = np.random.default_rng(2).uniform([-3, -2, 4], [3, 2, 12], (200, 3))
R_A_B, T_A_B = rotvec_to_rotmat(np.array([0.02, -0.15, 0.03])), np.array([0.8, 0.1, 0.2])


def pixels(points: np.ndarray) -> np.ndarray:
    return FOCAL * points[:, :2] / points[:, 2:]


def test_rays_point_at_what_the_pixels_show() -> None:
    np.testing.assert_allclose(rays(pixels(POINTS), FOCAL), unit(POINTS), atol=1e-12)


def test_the_rotation_between_directions_is_found_in_spite_of_outliers(rng: np.random.Generator) -> None:
    ray = unit(POINTS)
    direction = ray @ R_A_B.T
    direction[:40] = unit(rng.normal(size=(40, 3)))
    assert np.degrees(rotation_angle(wahba_rotation(direction, ray, np.eye(3)).T @ R_A_B)) < 0.01


def test_a_single_direction_leaves_the_rotation_as_it_was() -> None:
    assert wahba_rotation(np.ones((1, 3)), np.ones((1, 3)), R_A_B) is R_A_B


def test_a_camera_that_only_rotates_has_no_parallax() -> None:
    assert parallax_px(pixels(POINTS), pixels(POINTS @ R_A_B), FOCAL) < 1e-6
    assert parallax_px(pixels(POINTS), pixels((POINTS - T_A_B) @ R_A_B), FOCAL) > 5.0


def test_the_pose_of_the_second_view_is_found_up_to_scale() -> None:
    pose = five_point_pose(pixels(POINTS), pixels((POINTS - T_A_B) @ R_A_B), FOCAL, max_error_px=1.0)
    assert pose is not None
    assert np.degrees(rotation_angle(pose[0].T @ R_A_B)) < 0.01
    np.testing.assert_allclose(pose[1], unit(T_A_B), atol=1e-4)


def test_too_few_points_give_no_pose() -> None:
    assert five_point_pose(pixels(POINTS[:3]), pixels(POINTS[:3]), FOCAL, max_error_px=1.0) is None


@pytest.mark.parametrize(("kind", "least_px"), [("sideways", 5.0), ("dolly", 5.0)])
def test_a_moving_camera_has_pairs_with_safe_parallax(scene_of: Callable[..., Any], kind: str, least_px: float) -> None:
    scene = scene_of(kind, num_frames=30)
    shot = arrange(scene.points, scene.intrinsics.width, scene.intrinsics.height)
    pairs = starting_pairs(shot, choose_keyframes(shot), FOCAL)
    assert pairs
    assert all(pair.first < pair.second for pair in pairs)
    assert pairs[0].parallax_px > least_px
