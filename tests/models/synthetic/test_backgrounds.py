"""Tracked points of a simulated room: where the camera sees them, in the pictures that the stage would record."""

import numpy as np
import pytest

from humanmm.models.synthetic.backgrounds import build_room, track, within
from humanmm.models.synthetic.rigs import HEIGHT, WIDTH, ClipCamera, look_at

FPS, N = 30.0, 60
K = np.array([[1500.0, 0, WIDTH / 2], [0, 1500, HEIGHT / 2], [0, 0, 1]])
NOBODY = np.full((N, 4), np.nan)


def _camera(step_m: float) -> ClipCamera:
    eye = np.array([6.0, 0, 1.6]) + np.arange(N)[:, None] * [0, step_m, 0]
    return ClipCamera("dolly", np.tile(look_at(eye[0], np.zeros(3)), (N, 1, 1)), eye)


@pytest.fixture(scope="module")
def room() -> np.ndarray:
    return build_room(np.zeros(3), 7.0, np.random.default_rng(0))


def test_points_lie_within_the_walls_and_on_the_floor(room: np.ndarray) -> None:
    assert np.abs(room[:, :2]).max() < 7 + 8
    assert room[:, 2].min() == 0 and room[:, 2].max() <= 6
    assert 0.2 < (room[:, 2] == 0).mean() < 0.5


def test_tracked_points_are_projections_of_points_of_the_room(room: np.ndarray) -> None:
    camera = _camera(0.02)
    points = track(room, camera, K, NOBODY, (0, N), FPS, np.random.default_rng(1))
    frame = int(points.frame[len(points.frame) // 2])
    in_camera = (room - camera.t_world_cam[frame]) @ camera.R_world_cam[frame]
    in_camera = in_camera[in_camera[:, 2] > 0.3]
    projected = (in_camera @ K.T)[:, :2] / in_camera[:, 2:]
    xy = points.xy[points.frame == frame]
    distance = np.linalg.norm(xy[:, None] - projected[None], axis=-1).min(axis=1)
    assert np.median(distance) < 1.0
    assert (xy > 0).all() and (xy < [WIDTH, HEIGHT]).all()


def test_a_still_camera_has_few_recorded_frames_and_a_moving_one_many(room: np.ndarray) -> None:
    still, moving = (
        len(np.unique(track(room, _camera(step), K, NOBODY, (0, N), FPS, np.random.default_rng(1)).frame))
        for step in (0.0, 0.05)
    )
    assert still < moving == N


def test_no_point_lies_on_a_person(room: np.ndarray) -> None:
    box = np.tile([600.0, 200, 1300, 900], (N, 1))
    points = track(room, _camera(0.05), K, box, (10, 10 + N), FPS, np.random.default_rng(1))
    margin = 20  # jitter and drift
    inside = (points.xy > box[0, :2] + margin).all(-1) & (points.xy < box[0, 2:] - margin).all(-1)
    assert not inside.any()
    part = within(points, 20, 30)
    assert (part.start, part.end) == (20, 30)
    assert part.frame.min() >= 20 and part.frame.max() < 30
    assert len(part.frame) == ((points.frame >= 20) & (points.frame < 30)).sum()
