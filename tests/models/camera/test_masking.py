"""What lies on people is left out, and only that."""

from dataclasses import fields, replace
from typing import Any

import cv2
import numpy as np
import pytest

from humanmm.models.camera.masking import _near, background_points
from humanmm.models.records.camera import PointTracks
from humanmm.models.records.tracks import MASK_SIDE, PersonTrack, Silhouettes


def person(frames: list[int], left: float) -> PersonTrack:
    """A person of 100 × 200 px whose crop of 256 × 256 px starts at (left, 100); the silhouette is a box in its
    middle."""
    mask = np.zeros((128, 128), np.uint8)
    mask[14:114, 39:89] = 1
    count = len(frames)
    unused = {field.name: np.zeros((count, 0), np.float32) for field in fields(PersonTrack)}
    used: dict[str, Any] = {
        "frame": np.array(frames, np.int32),
        "bbox": np.tile(np.array([left + 78, 128, left + 178, 328], np.float32), (count, 1)),
        "masks": Silhouettes.pack(np.tile(mask, (count, 1, 1))),
        "mask_affine": np.tile(np.array([[2, 0, left], [0, 2, 100]], np.float32), (count, 1, 1)),
    }
    return PersonTrack(**{**unused, **used})


def points_at(xy: list[tuple[float, float]], num_frames: int) -> PointTracks:
    frame = np.repeat(np.arange(num_frames, dtype=np.int32), len(xy))
    track = np.tile(np.arange(len(xy), dtype=np.int32), num_frames)
    places = np.tile(np.array(xy, np.float32), (num_frames, 1))
    return PointTracks(0, num_frames, track, frame, places, np.ones(len(frame), np.float32), window_px=16.0)


def test_points_on_the_silhouette_and_within_half_a_window_go() -> None:
    inside, edge, outside = (300.0, 200.0), (272.0, 200.0), (250.0, 200.0)  # the silhouette begins at x = 278
    kept = background_points(points_at([inside, edge, outside], 10), [person(list(range(10)), 200.0)])
    assert len(kept.frame) == 10
    assert (kept.xy == outside).all()


def test_a_hole_in_a_persons_track_is_bridged() -> None:
    kept = background_points(points_at([(300.0, 200.0)], 20), [person([0, 1, 2, 18, 19], 200.0)])
    assert len(kept.frame) == 0


def test_a_person_seen_elsewhere_in_time_hides_nothing() -> None:
    points = points_at([(300.0, 200.0)], 20)
    kept = background_points(points, [person(list(range(100, 110)), 200.0)])
    assert len(kept.frame) == len(points.frame)


def test_a_track_goes_on_under_a_new_number_after_a_person_passed() -> None:
    kept = background_points(points_at([(300.0, 200.0)], 60), [person(list(range(25, 31)), 200.0)])
    before, after = kept.track[kept.frame < 20], kept.track[kept.frame > 40]
    assert len(np.unique(before)) == len(np.unique(after)) == 1
    assert before[0] != after[0]


def test_an_empty_mask_stands_for_the_whole_box() -> None:
    someone = replace(person(list(range(5)), 200.0), masks=Silhouettes.pack(np.zeros((5, 128, 128))))
    assert len(background_points(points_at([(280.0, 140.0)], 5), [someone]).frame) == 0


@pytest.mark.parametrize("radius", [1, 4, 17, 60])
def test_a_mask_is_widened_as_opencv_widens_it(radius: int) -> None:
    rng = np.random.default_rng(radius)
    mask = (cv2.GaussianBlur(rng.random((MASK_SIDE, MASK_SIDE)), (0, 0), 9) > 0.515).astype(np.uint8)
    mask[0, :3] = mask[-1, -1] = 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
    widened = np.pad(cv2.dilate(np.pad(mask, radius), kernel), 5)
    cells = rng.integers(-radius - 5, MASK_SIDE + radius + 5, (500, 2))
    expected = widened[cells[:, 1] + radius + 5, cells[:, 0] + radius + 5] > 0
    assert 0 < expected.sum() < len(cells)
    assert np.array_equal(_near(mask, cells, radius), expected)
