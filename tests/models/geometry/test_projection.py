"""The pinhole camera against OpenCV, and its round trips."""

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from humanmm.models.geometry.projection import (
    camera_to_world,
    in_front,
    inverse_pose,
    project,
    ray_axes,
    start_position,
    viewing_rays,
    world_to_camera,
)

K = np.array([[900.0, 4.0, 640.0], [0.0, 880.0, 360.0], [0.0, 0.0, 1.0]])
R = Rotation.random(5, random_state=1).as_matrix()
T = np.random.default_rng(0).normal(size=(5, 3))
POINTS = np.random.default_rng(1).normal(size=(5, 7, 3)) + np.array([0.0, 0.0, 6.0])


def test_world_and_camera_axes_are_inverse_to_each_other() -> None:
    np.testing.assert_allclose(camera_to_world(world_to_camera(POINTS, R, T), R, T), POINTS, atol=1e-12)
    np.testing.assert_allclose(camera_to_world(POINTS, *inverse_pose(R, T)), world_to_camera(POINTS, R, T), atol=1e-12)


def test_the_camera_stands_at_its_translation() -> None:
    np.testing.assert_allclose(world_to_camera(T[:, None], R, T), np.zeros((5, 1, 3)), atol=1e-12)


def test_pixels_are_opencvs() -> None:
    straight = np.where(K == 4.0, 0.0, K)  # OpenCV knows no skew
    for points, R_world_cam, t_world_cam in zip(POINTS, R, T, strict=True):
        world = camera_to_world(points, R_world_cam, t_world_cam)
        rotvec = cv2.Rodrigues(R_world_cam.T)[0]
        theirs = cv2.projectPoints(world, rotvec, -R_world_cam.T @ t_world_cam, straight, None)[0][:, 0]
        ours = project(world_to_camera(world, R_world_cam, t_world_cam), straight, near_m=0.1)
        np.testing.assert_allclose(ours, theirs, atol=1e-9)


def test_a_ray_through_the_pixel_of_a_point_meets_the_point() -> None:
    rays = viewing_rays(project(POINTS, np.tile(K, (5, 1, 1)), near_m=0.1), np.tile(K, (5, 1, 1)))
    np.testing.assert_allclose(rays * POINTS[..., 2:], POINTS, atol=1e-12)


def test_points_behind_the_camera_have_finite_pixels_and_are_said_to_be_behind() -> None:
    points = np.array([[0.1, 0.2, -3.0], [0.1, 0.2, 0.0], [0.1, 0.2, 3.0], [np.nan, 0.0, 3.0]])
    assert np.isfinite(project(points[:3], K, near_m=0.1)).all()
    assert in_front(points, 0.1).tolist() == [False, False, True, False]


def test_the_axes_of_a_ray_look_along_it() -> None:
    ray = POINTS[:, 0] / np.linalg.norm(POINTS[:, 0], axis=-1, keepdims=True)
    np.testing.assert_allclose(ray_axes(POINTS[:, 0])[..., 2], ray, atol=1e-12)


def test_the_position_that_puts_points_on_their_rays_is_found() -> None:
    rng = np.random.default_rng(0)
    points, origin = rng.normal(0, 0.5, (20, 33, 3)), rng.uniform([-1, -1, 3], [1, 1, 8], (20, 3))
    placed = points + origin[:, None]
    found = start_position(points, placed[..., :2] / placed[..., 2:], rng.uniform(0.1, 1.0, (20, 33)))
    np.testing.assert_allclose(found, origin, atol=1e-6)
