"""A closer cut of one camera's picture is told from another camera's."""

import cv2
import numpy as np
import pytest
from textured_wall import described, textured_wall

from humanmm.models.camera.background.enlarged import enlargement
from humanmm.models.camera.background.keyframes import FrameFeatures


def seen(picture: np.ndarray, scale: float, shift: tuple[float, float] = (0, 0), turn_deg: float = 0) -> FrameFeatures:
    motion = cv2.getRotationMatrix2D((450, 450), turn_deg, scale)
    motion[:, 2] += np.array([320 - 450, 240 - 450]) + shift
    return described(0, cv2.warpAffine(picture, motion, (640, 480)))


@pytest.mark.parametrize(("scale", "shift"), [(1.4, (0, 0)), (1.5, (40, -20)), (1 / 1.3, (0, 0))])
def test_an_enlarged_picture_gives_the_ratio_of_the_lenses(scale: float, shift: tuple[float, float]) -> None:
    wall = textured_wall(0)
    ratio = enlargement([seen(wall, 1.0)], [seen(wall, scale, shift)], 640)
    assert ratio == pytest.approx(scale, rel=0.01)


def test_the_same_picture_another_place_and_a_rolled_camera_are_no_enlargement() -> None:
    wall = textured_wall(1)
    whole = [seen(wall, 1.0)]
    assert enlargement(whole, [seen(wall, 1.0)], 640) is None
    assert enlargement(whole, [seen(textured_wall(2), 1.4)], 640) is None
    assert enlargement(whole, [seen(wall, 1.4, turn_deg=5)], 640) is None
    assert enlargement(whole, [], 640) is None and enlargement([], whole, 640) is None


def test_a_camera_that_goes_closer_is_no_enlargement() -> None:
    before = textured_wall(3)
    after = before.copy()
    bands = slice(130, 350), slice(350, 550), slice(550, 770)
    for band, scale in zip(bands, (1.1, 1.35, 1.6), strict=True):  # what is near grows more
        middle = (band.start + band.stop) / 2
        motion = cv2.getRotationMatrix2D((450, middle), 0, scale)
        after[band] = cv2.warpAffine(before, motion, (900, 900))[band]
    assert enlargement([seen(before, 1.0)], [seen(after, 1.0)], 640) is None
