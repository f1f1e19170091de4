"""Relative poses of two views of one place, against rotations that are known."""

import cv2
import numpy as np
import pytest

from humanmm.models.camera.keyframes import describe_view, drop_features, key_frames, link_views, match_features
from humanmm.models.records.shots import Shot, Transition

K = np.array([[700.0, 0, 320], [0, 700.0, 240], [0, 0, 1]])


def textured_wall(seed: int, side: int = 900) -> np.ndarray:
    """Blobs of many sizes and greys: something to recognise at every scale."""
    random = np.random.default_rng(seed)
    picture = np.full((side, side), 128, np.uint8)
    for _ in range(1500):
        centre = tuple(int(v) for v in random.integers(0, side, 2))
        cv2.circle(picture, centre, int(random.integers(3, 30)), int(random.integers(0, 256)), -1)
    return cv2.GaussianBlur(picture, (0, 0), 1.0)


def seen_by(wall: np.ndarray, R_cam_wall: np.ndarray) -> np.ndarray:
    """The wall, far away, through a camera turned by R_cam_wall about its own centre."""
    to_picture = K @ R_cam_wall @ np.linalg.inv(K) @ np.array([[1.0, 0, 320 - 450], [0, 1.0, 240 - 450], [0, 0, 1]])
    return cv2.warpPerspective(wall, to_picture, (640, 480))


def turn(yaw_deg: float, roll_deg: float) -> np.ndarray:
    return cv2.Rodrigues(np.radians([0.0, yaw_deg, roll_deg]))[0]


def angle_deg(R: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip((np.trace(R) - 1) / 2, -1, 1))))


def test_a_turned_camera_is_recovered_within_half_a_degree() -> None:
    wall, R_b_a = textured_wall(0), turn(9.0, 5.0)
    link = link_views(describe_view(3, seen_by(wall, np.eye(3))), describe_view(8, seen_by(wall, R_b_a)), K)
    assert link is not None and not link.same_camera
    assert (link.frame_a, link.frame_b) == (3, 8)
    assert angle_deg(link.R_a_b @ R_b_a) < 0.5  # SIFT's localisation, about 0.5 px at f = 700 px


def test_a_camera_that_did_not_move_is_told_as_such() -> None:
    picture = seen_by(textured_wall(1), np.eye(3))
    noisy = np.clip(picture + np.random.default_rng(0).normal(0, 4, picture.shape), 0, 255).astype(np.uint8)
    link = link_views(describe_view(0, picture), describe_view(1, noisy), K)
    assert link is not None and link.same_camera
    np.testing.assert_array_equal(link.R_a_b, np.eye(3))


def test_different_places_give_no_link() -> None:
    a, b = (describe_view(i, seen_by(textured_wall(seed), np.eye(3))) for i, seed in enumerate((2, 3)))
    assert link_views(a, b, K) is None


@pytest.mark.parametrize("gray", [np.zeros((480, 640), np.uint8), np.zeros((16, 16), np.uint8)])
def test_an_empty_picture_gives_no_features_and_no_link(gray: np.ndarray) -> None:
    view = describe_view(0, gray)
    assert len(view.xy) == 0 and link_views(view, view, K) is None


def test_hidden_features_take_no_part() -> None:
    view = describe_view(0, seen_by(textured_wall(4), np.eye(3)))
    hidden = view.xy[:, 0] < 320
    kept = drop_features(view, hidden)
    index_a, _ = match_features(kept, view)
    assert len(kept.xy) == (~hidden).sum() and (kept.xy[index_a, 0] >= 320).all()


def test_first_middle_and_last_clear_frame_stand_for_a_shot() -> None:
    dissolve, cut = Transition("dissolve", 15, 25, "scene"), Transition("cut", 60, 60, "scene")
    assert key_frames(Shot(0, 0, 100, 0, None, ())) == (0, 50, 99)
    assert key_frames(Shot(1, 20, 60, 0, dissolve, (), cut)) == (25, 42, 59)
    assert key_frames(Shot(0, 0, 20, 0, None, (), dissolve)) == (0, 7, 14)
    assert key_frames(Shot(1, 7, 8, 0, None, ())) == (7,)


def test_a_shot_without_a_clear_frame_has_no_key_frame() -> None:
    dissolves = [Transition("dissolve", middle - 8, middle + 8, "scene") for middle in (20, 30)]
    assert key_frames(Shot(1, 20, 30, 0, dissolves[0], (), dissolves[1])) == ()
