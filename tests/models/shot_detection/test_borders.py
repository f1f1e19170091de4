"""What fills the picture beside a film of another format is told from what was filmed."""

import cv2
import numpy as np
import pytest
from places import HEIGHT, WIDTH, Place

from humanmm.models.shot_detection.borders import black_bars, border

TALL = 192
"""Height of an upright picture, and the width of the film in it: 108."""
FILM = np.s_[66:126]


def film() -> list[np.ndarray]:
    """Pictures of a camera that turns, 108 × 60."""
    some = (Place(4).picture(10 * k, (12.0 * k, 0.0)) for k in range(6))
    return [cv2.cvtColor(cv2.resize(one, (108, 60)), cv2.COLOR_BGR2GRAY) for one in some]


def filled(picture: np.ndarray) -> np.ndarray:
    """A picture in the middle of its own enlarged, blurred and dimmed copy."""
    enlarged = cv2.resize(picture, (round(108 * TALL / 60), TALL))
    left = (enlarged.shape[1] - 108) // 2
    whole = (0.7 * cv2.GaussianBlur(enlarged[:, left : left + 108], (0, 0), 4)).astype(np.uint8)
    whole[FILM] = picture
    return whole


@pytest.mark.parametrize("upright", [True, False])
def test_a_blurred_copy_beside_a_film_was_not_filmed(upright: bool) -> None:
    pictures = [filled(one) if upright else filled(one).T for one in film()]
    found = border(pictures) if upright else border(pictures).T
    assert found[:66].all() and found[126:].all() and not found[70:122].any()


def test_a_picture_of_one_format_has_no_border() -> None:
    turning = [cv2.cvtColor(Place(k // 4).picture(0, (8.0 * k, 0.0)), cv2.COLOR_BGR2GRAY) for k in range(12)]
    assert not border(turning).any()


def test_blurred_pictures_of_something_else_are_no_copy() -> None:
    """A carpet and a ceiling out of focus above and below what is sharp."""
    pictures = [filled(one) for one in film()]
    for picture in pictures:
        picture[:66], picture[126:] = picture[:66, ::-1].copy(), picture[126:, ::-1].copy()
    assert not border(pictures).any()


def test_black_bars_are_beside_the_film_on_all_sides_and_nothing_of_a_black_picture_is() -> None:
    picture = np.full((HEIGHT, WIDTH), 90, np.uint8)
    picture[:10] = picture[-10:] = 16
    picture[:, :20] = picture[:, -20:] = 16
    assert not black_bars(picture)[14:-14, 24:-24].any() and black_bars(picture)[:, :20].all()
    assert not black_bars(np.full((HEIGHT, WIDTH), 16, np.uint8)).any()


def test_a_line_in_the_dark_is_not_between_bars() -> None:
    line = np.full((HEIGHT, WIDTH), 16, np.uint8)
    line[50:53] = 200
    assert not border([line]).any()
