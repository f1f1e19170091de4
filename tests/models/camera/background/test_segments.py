"""Straight edges of a picture, and their angles to directions in space."""

import cv2
import numpy as np
from room_edges import camera_towards, edges_of_a_room, seen_by

from humanmm.models.camera.background.segments import MAX_SEGMENTS, Segments, detect_segments
from humanmm.models.geometry.intrinsics import K_from_focal

K = K_from_focal(800.0, 960, 540)


def test_the_edges_of_a_drawn_board_are_found() -> None:
    picture = np.full((480, 640), 90, np.uint8)
    cv2.rectangle(picture, (100, 120), (499, 359), 200, -1)
    found = detect_segments(picture)
    sides = np.array([[100, 120, 500, 120], [100, 360, 500, 360], [100, 120, 100, 360], [500, 120, 500, 360]])
    for side in sides:
        ends = np.concatenate([found, found[:, [2, 3, 0, 1]]])
        assert np.abs(ends - side).max(axis=1).min() < 3  # LSD stops a pixel or two before a corner


def test_an_even_picture_has_no_edges_and_a_busy_one_only_the_longest() -> None:
    assert len(detect_segments(np.full((200, 300), 128, np.uint8))) == 0
    busy = np.kron(np.random.default_rng(0).integers(0, 255, (24, 32)), np.ones((20, 20))).astype(np.uint8)
    found = detect_segments(busy)
    length = np.linalg.norm(found[:, 2:] - found[:, :2], axis=1)
    assert len(found) <= MAX_SEGMENTS and (np.diff(length) <= 0).all()


def test_edges_along_a_direction_have_no_angle_to_it_in_the_picture() -> None:
    R_world_cam = camera_towards(35.0, 12.0)
    along_x = edges_of_a_room(np.random.default_rng(1), each=10, anywhere=0)[:10]
    seen = Segments.of([seen_by(along_x, R_world_cam, K)], [K], [R_world_cam])
    residual, _ = seen.residuals(np.eye(3))
    assert np.abs(residual[:, 0]).max() < 1e-6
    assert np.degrees(np.abs(residual[:, 2])).min() > 5


def test_several_pictures_of_a_shot_are_together_as_much_of_a_witness_as_one() -> None:
    ends = seen_by(edges_of_a_room(np.random.default_rng(2)), camera_towards(0.0, 10.0), K)
    one, three = (Segments.of([ends] * n, [K] * n, [np.eye(3)] * n) for n in (1, 3))
    np.testing.assert_allclose(three.weight.sum(), one.weight.sum())


def test_edges_of_a_large_picture_are_as_exact_as_those_of_the_reduced_one_in_which_they_were_found() -> None:
    ends = seen_by(edges_of_a_room(np.random.default_rng(2)), camera_towards(0.0, 10.0), K)
    of_size = {}
    for width in (640, 1280, 3840):
        scale = width / (2 * K[0, 2])
        of_size[width] = Segments.of([ends * scale], [np.diag([scale, scale, 1.0]) @ K], [np.eye(3)]).sigma
    np.testing.assert_allclose(of_size[3840], of_size[1280])
    assert (of_size[640] > of_size[1280]).all()
