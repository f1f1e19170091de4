"""The window of small pictures and what is measured in it."""

import cv2
import numpy as np
import pytest
from places import HEIGHT, WIDTH, Place

from humanmm.models.shot_detection.picture_window import PictureWindow

STEPS_S = np.random.default_rng(2).choice([0.02, 0.04, 0.1], 30)
TIME_S = np.cumsum(STEPS_S)


def filmed(pictures: list[np.ndarray], time_s: np.ndarray = TIME_S) -> PictureWindow:
    window = PictureWindow(time_s)
    for picture in pictures:
        window.append(picture)
    return window


def test_a_repeated_picture_is_frozen_and_changes_nothing() -> None:
    first, second = Place(1).picture(0), Place(2).picture(0)
    window = filmed([first, first, second])
    assert window.change[:2] == [0.0, 0.0] and window.frozen(1)
    assert window.change[2] > 20 and window.color_change[2] > 0.2 and not window.frozen(2)


def test_a_pan_has_its_speed_whatever_the_time_between_its_frames() -> None:
    place, speed_px_s = Place(3), 60.0
    window = filmed([place.picture(0, (speed_px_s * t, 0)) for t in TIME_S])
    assert window.usual_speed(15, 14) * WIDTH == pytest.approx(speed_px_s, rel=0.2)


def test_pictures_that_are_forgotten_leave_the_numbers_and_the_later_pictures() -> None:
    window = filmed(Place(4).still(12))
    luma, change = window.luma(9), list(window.change)
    window.forget_before(8)
    assert (window.first, window.end, len(window.gray)) == (8, 12, 4)
    assert window.change == change
    np.testing.assert_array_equal(window.luma(9), luma)
    assert window.displacement(8, 11) is not None


def test_a_street_at_night_is_not_uniform_as_a_black_picture_is() -> None:
    black = np.random.default_rng(0).integers(0, 3, (HEIGHT, WIDTH, 3)).astype(np.uint8)
    night = black.copy()
    for k in range(12):
        x, y = 10 + 15 * k, 12 + 37 * k % (HEIGHT - 24)
        night[y : y + 6, x : x + 6] += 40
    night = cv2.GaussianBlur(night, (0, 0), 1.0)
    window = filmed([black, night])
    assert max(window.contrast) < 4
    assert window.uniform == [True, False]
