"""The ground around people: where it is cut out, where nobody's ground is seen, and how its pixels are found again."""

from dataclasses import fields

import numpy as np
import pytest

from humanmm.models.camera.background.ground import (
    FRAMES,
    HIDDEN,
    MAX_SIDE_PX,
    GroundPicture,
    ground_around,
    ground_frames,
    hidden,
    whole_frame,
)
from humanmm.models.records.shots import Shot, Transition
from humanmm.models.records.tracks import PersonTrack, Silhouettes


def person(box: tuple[float, float, float, float], *, silhouette: bool = True) -> PersonTrack:
    """Somebody whose silhouette is the inner half of his box, in frame 3."""
    x0, y0, x1, y1 = box
    mask = np.zeros((1, 128, 128), np.uint8)
    if silhouette:
        mask[:, 32:96, 32:96] = 1
    affine = np.array([[[(x1 - x0) / 128, 0, x0], [0, (y1 - y0) / 128, y0]]], np.float32)
    blank = {field.name: np.zeros(0) for field in fields(PersonTrack)}
    given = {"frame": np.array([3]), "bbox": np.array([box]), "lifted": False}
    return PersonTrack(**blank | given | {"masks": Silhouettes.pack(mask), "mask_affine": affine})  # type: ignore[arg-type]


def picture() -> np.ndarray:
    """640 x 360, as bright as the column is far to the right."""
    return np.tile(np.linspace(10, 250, 640), (360, 1)).round().astype(np.uint8)


def test_frames_are_spread_over_the_shot_outside_transitions() -> None:
    dissolve = Transition("dissolve", 10, 20, "scene")
    frames = ground_frames(Shot(1, 15, 81, 0, dissolve, ()))
    assert len(frames) == FRAMES and frames[0] == 20 and frames[-1] == 80
    assert ground_frames(Shot(0, 0, 2, 0, None, ())) == (0, 1)
    whole = [Transition("dissolve", at - 9, at + 9, "scene") for at in (20, 30)]
    assert ground_frames(Shot(1, 20, 30, 0, whole[0], (), whole[1])) == ()


def test_the_ground_about_the_feet_is_kept_and_the_person_left_out() -> None:
    found = ground_around(3, picture(), [person((500, 200, 560, 320))], 2.0)
    assert found is not None and found.scale == pytest.approx(2.0)
    inside = found.pixels(np.array([530.0, 260.0, 530.0, 260.0]))[:2].astype(int)
    beside = found.pixels(np.array([530.0, 318.0, 530.0, 318.0]))[:2].astype(int)
    assert found.gray[inside[1], inside[0]] == HIDDEN
    expected = picture()[159, 265]
    assert found.gray[beside[1], beside[0]] == pytest.approx(expected, abs=2)


def test_a_box_stands_in_for_a_silhouette_that_is_not_known() -> None:
    found = ground_around(3, picture(), [person((500, 200, 560, 320), silhouette=False)], 2.0)
    assert found is not None
    low, high = (found.pixels(np.array([x, y, x, y], float))[:2].astype(int) for x, y in ((502, 202), (558, 318)))
    assert (found.gray[low[1] : high[1], low[0] : high[0]] == HIDDEN).all()
    assert (found.gray != HIDDEN).any()


def test_pictures_are_small_whoever_fills_the_frame() -> None:
    found = ground_around(3, picture(), [person((100, 10, 500, 350))], 1.0)
    assert found is not None and max(found.gray.shape) <= MAX_SIDE_PX and found.scale >= 2


def test_intrinsics_follow_the_part() -> None:
    K = np.array([[900.0, 0, 480], [0, 900, 270], [0, 0, 1]])
    part = GroundPicture(0, np.array([100, 60], np.float32), 2.5, np.ones((20, 30), np.uint8))
    point = np.array([0.3, 0.2, 2.0])
    whole, reduced = (k @ point for k in (K, part.in_picture(K)))
    np.testing.assert_allclose(reduced[:2] / reduced[2], (whole[:2] / whole[2] - part.corner) / 2.5, atol=1e-9)


def test_without_anybody_there_is_no_ground() -> None:
    assert ground_around(4, picture(), [person((500, 200, 560, 320))], 1.0) is None
    assert ground_around(3, picture(), [person((500, 200, 505, 210))], 1.0) is None
    assert ground_around(3, picture(), [person((900, 200, 960, 320))], 1.0) is None


def test_what_is_burned_in_is_hidden() -> None:
    burned_in = (80.0, 180.0, 200.0, 240.0)
    around = ground_around(3, picture(), [person((100.0, 100.0, 160.0, 240.0))], 1.0)
    assert around is not None
    for one in (whole_frame(3, picture(), [], 1.0), around):
        left_out = hidden(one, [burned_in])
        x0, y0, x1, y1 = one.pixels(np.array(burned_in)).round().astype(int)
        assert (left_out.gray[y0:y1, x0:x1] == HIDDEN).all()
        left_out.gray[y0:y1, x0:x1] = one.gray[y0:y1, x0:x1]
        np.testing.assert_array_equal(left_out.gray, one.gray)
