"""Tracked points of a room: they are where the camera sees the room, and a still picture is not recorded."""

import numpy as np

from humanmm.models.synthetic.backgrounds import build_room, track, within
from humanmm.models.synthetic.rigs import HEIGHT, WIDTH, ClipCamera, look_at

N, FPS = 30, 30.0
K = np.array([[1400.0, 0, WIDTH / 2], [0, 1400, HEIGHT / 2], [0, 0, 1]])
CENTRE = np.array([1.0, 2.0, 0.9])
NOBODY = np.full((N, 4), np.nan)


def camera(speed_ms: float) -> ClipCamera:
    eye = CENTRE + np.array([5.0, 0.0, 0.5]) + np.arange(N)[:, None] / FPS * speed_ms * np.array([0.0, 1.0, 0.0])
    R = look_at(eye[0], CENTRE)
    return ClipCamera("dolly", np.tile(R, (N, 1, 1)), eye)


def room() -> np.ndarray:
    return build_room(CENTRE, 6.0, np.random.default_rng(0))


def test_the_room_stands_on_the_floor_about_its_centre() -> None:
    points = room()
    assert points[:, 2].min() == 0.0
    assert (np.abs(points[:, :2] - CENTRE[:2]).max(axis=0) < 6.0 + 8.0).all()
    assert np.abs(points[:, :2] - CENTRE[:2]).max() > 6.0


def test_tracks_lie_in_the_picture_and_every_track_once_in_a_frame() -> None:
    points = track(room(), camera(0.5), K, NOBODY, (10, 10 + N), FPS, np.random.default_rng(1))
    assert len(points.frame) > 1000
    assert (points.xy > 0).all()
    assert (points.xy < [WIDTH, HEIGHT]).all()
    assert (points.frame.min(), points.frame.max()) == (10, 10 + N - 1)
    assert len(np.unique(np.stack([points.track, points.frame]), axis=1).T) == len(points.frame)


def test_a_static_camera_records_its_first_and_last_picture_and_few_between() -> None:
    still = track(room(), camera(0.0), K, NOBODY, (0, N), FPS, np.random.default_rng(1))
    moving = track(room(), camera(2.0), K, NOBODY, (0, N), FPS, np.random.default_rng(1))
    assert {0, N - 1} <= set(still.frame.tolist())
    assert len(np.unique(still.frame)) < 0.5 * len(np.unique(moving.frame))


def test_a_person_hides_the_wall() -> None:
    box = np.tile([600.0, 200.0, 1200.0, 900.0], (N, 1))
    points = track(room(), camera(0.5), K, box, (0, N), FPS, np.random.default_rng(1))
    inside = ((points.xy > box[0, :2] + 30) & (points.xy < box[0, 2:] - 30)).all(axis=1)  # jitter and drift aside
    assert not inside.any()


def test_a_part_of_a_clip_has_the_tracks_of_its_frames() -> None:
    points = track(room(), camera(0.5), K, NOBODY, (0, N), FPS, np.random.default_rng(1))
    part = within(points, 5, 12)
    assert (part.start, part.end) == (5, 12)
    assert set(part.frame.tolist()) <= set(range(5, 12))
