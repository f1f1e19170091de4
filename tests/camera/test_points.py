"""Points stay on what they were put on."""

import cv2
import numpy as np

from humanmm.models.camera.points import TrackerSettings, track_points

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
    points = track_points(pictures, start=100, source_size=(WIDTH, HEIGHT), settings=TrackerSettings())
    first, last = points.frame == 100, points.frame == 119
    both, a, b = np.intersect1d(points.track[first], points.track[last], return_indices=True)
    moved = points.xy[last][b] - points.xy[first][a]
    assert len(both) > 60
    expected = [-x[-1], -0.4 * x[-1]]
    np.testing.assert_allclose(np.median(moved, axis=0), expected, atol=0.1)  # warpAffine itself rounds to 1/32 px
    assert np.quantile(np.abs(moved - expected), 0.9) < 0.5


def test_points_cover_the_picture_evenly() -> None:
    points = track_points([texture()[:HEIGHT, :WIDTH]], start=0, source_size=(2 * WIDTH, 2 * HEIGHT),
                          settings=TrackerSettings(num_points=128))  # fmt: skip
    counts, _, _ = np.histogram2d(*points.xy.T, bins=(4, 3), range=((0, 2 * WIDTH), (0, 2 * HEIGHT)))
    assert counts.min() >= 0.5 * counts.mean()


def test_a_standing_picture_costs_few_observations() -> None:
    rng = np.random.default_rng(1)
    still = texture()[:HEIGHT, :WIDTH].astype(float)
    pictures = [np.clip(still + rng.normal(0, 2.0, still.shape), 0, 255).astype(np.uint8) for _ in range(50)]
    points = track_points(pictures, start=0, source_size=(WIDTH, HEIGHT), settings=TrackerSettings())
    recorded = np.unique(points.frame)
    assert recorded[0] == 0 and recorded[-1] == 49
    assert len(recorded) < 10


def test_no_pictures_and_a_blank_picture_give_no_points() -> None:
    blank = np.full((HEIGHT, WIDTH), 90, np.uint8)
    for pictures in ([], [blank, blank, blank]):
        points = track_points(pictures, start=7, source_size=(WIDTH, HEIGHT), settings=TrackerSettings())
        assert (points.start, points.end) == (7, 7 + len(pictures))
        assert len(points.track) == 0


def test_a_flash_does_not_end_the_tracks() -> None:
    pictures = [window(texture(), 0.5 * k, 0.0) for k in range(12)]
    pictures[6] = np.full_like(pictures[6], 250)
    points = track_points(pictures, start=0, source_size=(WIDTH, HEIGHT), settings=TrackerSettings())
    first, last = points.track[points.frame == 0], points.track[points.frame == 11]
    assert len(np.intersect1d(first, last)) > 0.7 * len(first)
