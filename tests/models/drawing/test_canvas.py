"""Drawing on planes of luma and chroma: colours as a decoder delivers them, nothing outside, borders exact."""

import numpy as np
import pytest

from humanmm.models.drawing.canvas import Canvas
from humanmm.models.video.colors import BT601

RED = (255, 0, 0)
Y, CB, CR = BT601.samples(np.array(RED, np.uint8)).tolist()


def _picture() -> np.ndarray:
    return np.full((60, 60), 128, np.uint8)  # 60 × 40


def _luma(picture: np.ndarray) -> np.ndarray:
    return picture[:40]


def test_a_rectangle_has_its_colour_in_all_planes_and_nothing_beside_it_changes() -> None:
    picture = _picture()
    Canvas(picture, BT601).rectangle(10, 20, 30, 24, RED)
    expected = np.full((40, 60), 128)
    expected[20:24, 10:30] = Y
    np.testing.assert_array_equal(_luma(picture), expected)
    chroma = picture.reshape(-1)[40 * 60 :].reshape(2, 20, 30)
    assert (chroma[0] == CB).sum() == (chroma[1] == CR).sum() == 2 * 10


def test_what_lies_outside_is_cut_off() -> None:
    picture = _picture()
    canvas = Canvas(picture, BT601)
    canvas.rectangle(-50, -50, -1, -1, RED)
    canvas.rectangle(100, 0, 200, 40, RED)
    canvas.stamp(-20, 39, np.full((4, 10), 255, np.uint8), RED)
    assert (picture == 128).all()
    canvas.rectangle(-5, -5, 500, 500, RED)
    assert (_luma(picture) == Y).all()


@pytest.mark.parametrize(("x", "y"), [(10, 10), (11, 10), (10, 11), (-3, -3), (55, 37)])
def test_a_stamp_covers_its_pixels_in_luma_wherever_it_lies(x: int, y: int) -> None:
    picture = _picture()
    Canvas(picture, BT601).stamp(x, y, np.full((6, 8), 255, np.uint8), RED)
    expected = np.full((40, 60), 128)
    expected[max(y, 0) : y + 6, max(x, 0) : x + 8] = Y
    np.testing.assert_array_equal(_luma(picture), expected)


def test_half_the_opacity_lies_half_way() -> None:
    picture = _picture()
    Canvas(picture, BT601).rectangle(0, 0, 60, 40, RED, 0.5)
    assert abs(int(picture[5, 5]) - (128 + Y) / 2) <= 1


def test_a_polygon_fills_its_area() -> None:
    picture = _picture()
    Canvas(picture, BT601).polygon(np.array([[10.0, 10], [40, 10], [40, 30], [10, 30]]), RED)
    assert (_luma(picture) == Y).sum() == pytest.approx(600, abs=60)
