"""The background that a camera has placed in space, in the world of the recording."""

from dataclasses import replace

import numpy as np
import two_people

from humanmm.models.geometry.projection import project, world_to_camera
from humanmm.models.motion.scenery import scenery_in_world

RECORDING = two_people.recording()
FRAMES = slice(0, two_people.CUT)
IN_VIEW = np.random.default_rng(0).uniform([-2, 1, 0], [2, 6, 2], (30, 3))
SURE = np.full(30, 0.01)


def pixels(points: np.ndarray, focal: float = 1.0) -> np.ndarray:
    """(frames, points, 2) of points of the world in the first shot."""
    K = RECORDING.K[FRAMES] * np.array([[focal, 1, 1], [1, focal, 1], [1, 1, 1]])
    R, t = RECORDING.R_world_cam[FRAMES].astype(float), RECORDING.t_world_cam[FRAMES].astype(float)
    return project(world_to_camera(points, R, t), K, near_m=0.01)


def test_points_are_where_the_cameras_of_the_recording_see_them_whatever_the_unit_of_the_path() -> None:
    for unit_m in (0.2, 3.0):
        found = scenery_in_world(two_people.travelling_camera(IN_VIEW, SURE, unit_m=unit_m), RECORDING)
        np.testing.assert_allclose(found, IN_VIEW, atol=1e-4)


def test_with_another_focal_length_points_stay_in_their_pixels_and_are_farther_away() -> None:
    camera = two_people.travelling_camera(IN_VIEW, SURE)
    longer = replace(RECORDING, K=RECORDING.K * np.float32([[1.05, 1, 1], [1, 1.05, 1], [1, 1, 1]]))
    found = scenery_in_world(camera, longer)
    off = np.linalg.norm(pixels(found, 1.05) - pixels(IN_VIEW), axis=-1)
    assert off.min(axis=0).max() < 0.05, "in the frame in the middle"
    unmoved = np.linalg.norm(pixels(IN_VIEW, 1.05) - pixels(IN_VIEW), axis=-1)
    assert off.max() < 0.2 * unmoved.max()
    centre = RECORDING.t_world_cam[two_people.CUT // 2]
    farther = np.linalg.norm(found - centre, axis=1) / np.linalg.norm(IN_VIEW - centre, axis=1)
    assert (farther > 1.02).all() and (farther < 1.06).all()


def test_points_of_hardly_known_distance_and_points_in_no_picture_are_left_out() -> None:
    behind = np.array([[0.0, -9.0, 1.0]])
    unsure = np.where(np.arange(30) < 10, 0.9, 0.01)
    camera = two_people.travelling_camera(np.concatenate([IN_VIEW, behind]), np.append(unsure, 0.01))
    np.testing.assert_allclose(scenery_in_world(camera, RECORDING), IN_VIEW[10:], atol=1e-4)
    nothing = two_people.travelling_camera(behind, np.array([0.01]))
    assert scenery_in_world(nothing, RECORDING).shape == (0, 3)


def test_a_camera_that_does_not_travel_has_placed_nothing() -> None:
    camera = two_people.travelling_camera(IN_VIEW, SURE)
    static = replace(camera, t_shot_cam=np.zeros_like(camera.t_shot_cam), scenery=None, metric=True)
    assert scenery_in_world(static, RECORDING).shape == (0, 3)
