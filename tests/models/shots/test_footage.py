"""The window of small pictures and what is measured in it."""

import numpy as np
import pytest
from places import WIDTH, Place

from humanmm.models.shots.footage import Footage

STEPS_S = np.random.default_rng(2).choice([0.02, 0.04, 0.1], 30)
TIME_S = np.cumsum(STEPS_S)


def filmed(pictures: list[np.ndarray], time_s: np.ndarray = TIME_S) -> Footage:
    footage = Footage(time_s)
    for picture in pictures:
        footage.append(picture)
    return footage


def test_a_repeated_picture_is_frozen_and_changes_nothing() -> None:
    first, second = Place(1).picture(0), Place(2).picture(0)
    footage = filmed([first, first, second])
    assert footage.change[:2] == [0.0, 0.0] and footage.frozen(1)
    assert footage.change[2] > 20 and footage.color_change[2] > 0.2 and not footage.frozen(2)


def test_a_pan_has_its_speed_whatever_the_time_between_its_frames() -> None:
    place, speed_px_s = Place(3), 60.0
    footage = filmed([place.picture(0, (speed_px_s * t, 0)) for t in TIME_S])
    assert footage.usual_speed(15, 14) * WIDTH == pytest.approx(speed_px_s, rel=0.2)


def test_pictures_that_are_forgotten_leave_the_numbers_and_the_later_pictures() -> None:
    footage = filmed(Place(4).still(12))
    luma, change = footage.luma(9), list(footage.change)
    footage.forget_before(8)
    assert (footage.first, footage.end, len(footage.gray)) == (8, 12, 4)
    assert footage.change == change
    np.testing.assert_array_equal(footage.luma(9), luma)
    assert footage.displacement(8, 11) is not None
