"""Relative poses of two frames of one scene, against rotations that are known."""

import cv2
import numpy as np
import pytest
from textured_wall import described, textured_wall

from humanmm.models.camera.background.frame_edges import essential_probability, find_frame_edge, plane_probability

K = np.array([[700.0, 0, 320], [0, 700.0, 240], [0, 0, 1]])


def seen_by(wall: np.ndarray, R_cam_wall: np.ndarray) -> np.ndarray:
    """The wall, far away, through a camera turned by R_cam_wall about its own centre."""
    to_picture = K @ R_cam_wall @ np.linalg.inv(K) @ np.array([[1.0, 0, 320 - 450], [0, 1.0, 240 - 450], [0, 0, 1]])
    return cv2.warpPerspective(wall, to_picture, (640, 480))


def turn(yaw_deg: float, roll_deg: float) -> np.ndarray:
    return cv2.Rodrigues(np.radians([0.0, yaw_deg, roll_deg]))[0]


def angle_deg(R: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip((np.trace(R) - 1) / 2, -1, 1))))


def test_a_rotated_camera_is_recovered_within_half_a_degree() -> None:
    wall, R_b_a = textured_wall(0), turn(9.0, 5.0)
    edge = find_frame_edge(described(3, seen_by(wall, np.eye(3))), described(8, seen_by(wall, R_b_a)), K)
    assert edge is not None and not edge.same_camera
    assert (edge.frame_a, edge.frame_b) == (3, 8)
    off = {one.source: angle_deg(one.R_a_b @ R_b_a) for one in reversed(edge.hypotheses)}
    # SIFT's localisation, about 0.5 px at f = 700 px
    assert off["essential matrix"] < 0.5 and off["plane"] < 0.5
    assert edge.probability > 0.9


def test_a_camera_that_did_not_move_is_recognised() -> None:
    picture = seen_by(textured_wall(1), np.eye(3))
    noisy = np.clip(picture + np.random.default_rng(0).normal(0, 4, picture.shape), 0, 255).astype(np.uint8)
    edge = find_frame_edge(described(0, picture), described(1, noisy), K)
    assert edge is not None and edge.same_camera
    np.testing.assert_array_equal(edge.hypotheses[0].R_a_b, np.eye(3))


def test_different_scenes_give_no_edge() -> None:
    a, b = (described(i, seen_by(textured_wall(seed), np.eye(3))) for i, seed in enumerate((2, 3)))
    assert find_frame_edge(a, b, K) is None


@pytest.mark.parametrize("gray", [np.zeros((480, 640), np.uint8), np.zeros((16, 16), np.uint8)])
def test_an_empty_picture_gives_no_features_and_no_edge(gray: np.ndarray) -> None:
    features = described(0, gray)
    assert len(features.xy) == 0 and find_frame_edge(features, features, K) is None


def test_a_plane_seen_from_two_places_gives_both_of_its_rotations() -> None:
    wall, R_b_a = textured_wall(4), turn(20.0, 0.0)
    normal, shift = np.array([0.0, 0.0, 1.0]), np.array([-0.35, 0.0, 0.05])
    H = K @ (R_b_a + np.outer(shift, normal)) @ np.linalg.inv(K)
    first = seen_by(wall, np.eye(3))
    second = cv2.warpPerspective(first, H, (640, 480))
    edge = find_frame_edge(described(0, first), described(1, second), K)
    assert edge is not None
    planes = [one for one in edge.hypotheses if one.source == "plane"][:2]
    assert len(planes) == 2 and min(angle_deg(one.R_a_b @ R_b_a) for one in planes) < 2.0


def test_few_inliers_are_hardly_believed() -> None:
    assert essential_probability(20) < 0.1 and essential_probability(90) > 0.8
    assert plane_probability(10) < 0.15 and 0.8 < plane_probability(40) < 0.9
