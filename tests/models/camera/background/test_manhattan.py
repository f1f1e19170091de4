"""The directions of a room from its edges in a picture."""

import numpy as np
import pytest
from room_edges import camera_towards, edges_of_a_room, seen_by

from humanmm.models.camera.background.manhattan import QUARTER_TURNS, find_manhattan_frame, off_deg
from humanmm.models.camera.background.segments import Segments
from humanmm.models.geometry.intrinsics import K_from_focal
from humanmm.models.geometry.rotations import rotvec_to_rotmat

K = K_from_focal(800.0, 960, 540)


def edges_in_camera(
    heading_deg: float, down_deg: float, seed: int, noise_px: float = 0.5
) -> tuple[Segments, np.ndarray]:
    """A room's edges in the camera's axes, and its directions there."""
    random = np.random.default_rng(seed)
    R_world_cam = camera_towards(heading_deg, down_deg)
    ends = seen_by(edges_of_a_room(random), R_world_cam, K)
    return Segments.of([ends + random.normal(0, noise_px, ends.shape)], [K], [np.eye(3)]), R_world_cam.T


@pytest.mark.parametrize(("heading_deg", "down_deg", "seed"), [(20.0, 5.0, 0), (65.0, 20.0, 1), (140.0, -8.0, 2)])
def test_up_and_heading_are_found_although_people_lean_by_ten_degrees(
    heading_deg: float, down_deg: float, seed: int
) -> None:
    seen, R_cam_world = edges_in_camera(heading_deg, down_deg, seed)
    leaning = rotvec_to_rotmat(np.radians([7.0, 0.0, 7.0])) @ R_cam_world[:, 2]
    found = find_manhattan_frame(seen, leaning, 10.0)
    assert found is not None and found.margin > 10
    # 42 edges of 1 to 2 m at 0.5 px: a few tenths of a degree
    assert off_deg(found.R_axes_walls, R_cam_world) < 1.0
    assert np.degrees(np.arccos(found.up @ R_cam_world[:, 2])) < 1.0


def test_edges_that_run_anywhere_are_no_frame() -> None:
    random = np.random.default_rng(3)
    ends = seen_by(edges_of_a_room(random, each=0, anywhere=60), camera_towards(0.0, 10.0), K)
    found = find_manhattan_frame(Segments.of([ends], [K], [np.eye(3)]), np.array([0.0, -1.0, 0.0]), 10.0)
    assert found is not None and found.margin < 5


def test_one_direction_alone_leaves_the_vertical_uncertain() -> None:
    random = np.random.default_rng(4)
    R_world_cam = camera_towards(30.0, 10.0)
    along_x = edges_of_a_room(random, each=30, anywhere=0)[:30]
    ends = seen_by(along_x, R_world_cam, K)
    found = find_manhattan_frame(Segments.of([ends], [K], [np.eye(3)]), R_world_cam.T[:, 2], 10.0)
    assert found is not None and found.sigma_deg > 3


def test_too_few_edges_are_no_frame() -> None:
    seen, R_cam_world = edges_in_camera(20.0, 5.0, 0)
    few = Segments(seen.normal[:5], seen.middle[:5], seen.sigma[:5], seen.weight[:5])
    assert find_manhattan_frame(few, R_cam_world[:, 2], 10.0) is None


def test_quarter_turns_leave_a_frame_what_it_is() -> None:
    frame = rotvec_to_rotmat(np.array([0.3, -0.2, 0.5]))
    for turn in QUARTER_TURNS:
        assert off_deg(frame, frame @ turn) < 1e-5
    assert abs(off_deg(frame, frame @ rotvec_to_rotmat(np.array([0.0, 0.0, np.pi / 4]))) - 45) < 1e-5
