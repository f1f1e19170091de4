"""Points stay on what they were put on."""

import cv2
import numpy as np
import pytest

from humanmm.models.camera.estimate import camera_from_points
from humanmm.models.camera.klt import klt_tracks
from humanmm.models.camera.shot_points import within
from humanmm.models.records.camera import Intrinsics

WIDTH, HEIGHT = 480, 270


def texture(seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    noise = cv2.GaussianBlur(rng.normal(0, 1, (HEIGHT + 200, WIDTH + 200)).astype(np.float32), (0, 0), 2.0)
    return np.clip(noise / noise.std() * 40 + 120, 0, 255).astype(np.uint8)


def window(picture: np.ndarray, x: float, y: float) -> np.ndarray:
    shift = np.array([[1, 0, -x], [0, 1, -y]], np.float32)
    return np.asarray(cv2.warpAffine(picture, shift, (WIDTH, HEIGHT), flags=cv2.INTER_CUBIC))


def test_points_follow_a_shift_through_changes_of_exposure() -> None:
    wide = texture()
    x = 3.3 * np.arange(20)
    pictures = [cv2.convertScaleAbs(window(wide, dx, 0.4 * dx), alpha=1 - 0.3 * (k % 3) / 2) for k, dx in enumerate(x)]
    points = klt_tracks(pictures, start=100, source_size=(WIDTH, HEIGHT))
    first, last = points.frame == 100, points.frame == 119
    both, a, b = np.intersect1d(points.track[first], points.track[last], return_indices=True)
    moved = points.xy[last][b] - points.xy[first][a]
    assert len(both) > 60
    expected = [-x[-1], -0.4 * x[-1]]
    np.testing.assert_allclose(np.median(moved, axis=0), expected, atol=0.1)  # warpAffine itself rounds to 1/32 px
    assert np.quantile(np.abs(moved - expected), 0.9) < 0.5


def test_points_cover_the_picture_evenly() -> None:
    points = klt_tracks([texture()[:HEIGHT, :WIDTH]], start=0, source_size=(2 * WIDTH, 2 * HEIGHT),
                          num_points=128)  # fmt: skip
    counts, _, _ = np.histogram2d(*points.xy.T, bins=(4, 3), range=((0, 2 * WIDTH), (0, 2 * HEIGHT)))
    assert counts.min() >= 0.5 * counts.mean()


def test_a_standing_picture_costs_few_observations() -> None:
    rng = np.random.default_rng(1)
    still = texture()[:HEIGHT, :WIDTH].astype(float)
    pictures = [np.clip(still + rng.normal(0, 2.0, still.shape), 0, 255).astype(np.uint8) for _ in range(50)]
    points = klt_tracks(pictures, start=0, source_size=(WIDTH, HEIGHT))
    recorded = np.unique(points.frame)
    assert recorded[0] == 0 and recorded[-1] == 49
    assert len(recorded) < 10


def test_no_pictures_and_a_blank_picture_give_no_points() -> None:
    blank = np.full((HEIGHT, WIDTH), 90, np.uint8)
    for pictures in ([], [blank, blank, blank]):
        points = klt_tracks(pictures, start=7, source_size=(WIDTH, HEIGHT))
        assert (points.start, points.end) == (7, 7 + len(pictures))
        assert len(points.track) == 0


def test_a_flash_does_not_end_the_tracks() -> None:
    pictures = [window(texture(), 0.5 * k, 0.0) for k in range(12)]
    pictures[6] = np.full_like(pictures[6], 250)
    points = klt_tracks(pictures, start=0, source_size=(WIDTH, HEIGHT))
    first, last = points.track[points.frame == 0], points.track[points.frame == 11]
    assert len(np.intersect1d(first, last)) > 0.7 * len(first)


def test_a_change_that_stays_is_recorded_on_both_sides() -> None:
    pictures = [window(texture(k >= 10), 0.01 * k, 0.0) for k in range(20)]
    points = klt_tracks(pictures, start=100, source_size=(WIDTH, HEIGHT))
    assert {100, 109, 110, 119} <= set(points.frame.tolist())
    before, after = points.track[points.frame == 109], points.track[points.frame == 110]
    assert not len(np.intersect1d(before, after)), "what survives are chance matches"
    assert len(np.intersect1d(after, points.track[points.frame == 119])) > 0.7 * len(after)


@pytest.mark.parametrize("px_per_frame", [30.0, 110.0])
def test_points_are_followed_through_a_quick_turn(px_per_frame: float) -> None:
    """A camera that turns by 30 degrees in a second, filmed at 30 and at 5 Hz or less."""
    wide = cv2.resize(texture(), None, fx=2, fy=1)
    pictures = [window(wide, px_per_frame * k, 0.0) for k in range(6)]
    points = klt_tracks(pictures, start=0, source_size=(WIDTH, HEIGHT))
    for frame in range(5):
        here, there = points.frame == frame, points.frame == frame + 1
        both, a, b = np.intersect1d(points.track[here], points.track[there], return_indices=True)
        moved = points.xy[there][b] - points.xy[here][a]
        assert len(both) > 60
        assert np.quantile(np.abs(moved - [-px_per_frame, 0.0]), 0.9) < 0.5


@pytest.mark.parametrize("focal_px", [600.0])
def test_a_cut_inside_a_tracked_scene_leaves_a_good_camera_on_both_sides(focal_px: float) -> None:
    turn = np.radians(0.3) * np.r_[np.arange(25), np.zeros(15)]  # a pan, then a static camera elsewhere
    wide = cv2.resize(texture(2), None, fx=2, fy=2)
    pictures = [_turned(texture(3) if k >= 25 else wide, angle, focal_px) for k, angle in enumerate(turn)]
    scene = klt_tracks(pictures, start=0, source_size=(WIDTH, HEIGHT))
    intrinsics = Intrinsics(focal_px, WIDTH, HEIGHT, "given", 0.0)
    pan = camera_from_points(within(scene, 0, 25), [], intrinsics)
    rest = camera_from_points(within(scene, 25, 40), [], intrinsics)
    assert (pan.source, rest.source) == ("rotation_only", "static")
    assert (len(pan.R_shot_cam), len(rest.R_shot_cam)) == (25, 15)
    assert not pan.warnings and not rest.warnings
    found = [np.arctan2(R[0, 2], R[2, 2]) for R in pan.R_shot_cam]
    np.testing.assert_allclose(found, turn[:25], atol=np.radians(0.05))  # a third of a pixel


def _turned(place: np.ndarray, angle: float, focal_px: float) -> np.ndarray:
    """What a camera sees that is turned to the right by this angle, of a place far away."""
    c, s = np.cos(angle), np.sin(angle)
    K = np.array([[focal_px, 0, WIDTH / 2], [0, focal_px, HEIGHT / 2], [0, 0, 1]])
    R = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    from_picture = np.linalg.inv(K @ R.T @ np.linalg.inv(K))
    half = np.array([[1, 0, -0.5], [0, 1, -0.5], [0, 0, 1]])
    to_place = np.array([[1, 0, 80], [0, 1, 80], [0, 0, 1]]) @ half @ from_picture @ np.linalg.inv(half)
    return np.asarray(
        cv2.warpPerspective(place, to_place, (WIDTH, HEIGHT), flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP)
    )


def test_points_are_looked_for_as_soon_as_a_fade_from_black_shows_something() -> None:
    wide, pictures = texture(2), []
    for k, light in enumerate(np.clip(np.arange(30) / 10, 0, 1)):
        picture = cv2.convertScaleAbs(window(wide, 2.0 * k, 0), alpha=light)
        picture[20:30, 20:30] = 60  # all that there is to be seen at first
        pictures.append(picture)
    points = klt_tracks(pictures, start=0, source_size=(WIDTH, HEIGHT))
    lasting = np.intersect1d(points.track[points.frame == 8], points.track[points.frame == 29])
    assert len(lasting) > 60, "not only once those few are lost"
