"""Measures of small gray pictures against known shifts and light."""

import cv2
import numpy as np
import pytest
from places import HEIGHT, WIDTH, Place, marbled

from humanmm.models.shot_detection.similarity import (
    MotionMeter,
    PlaceRecogniser,
    color_histogram,
    mean_shift,
)


def gray(seed: int, offset: tuple[float, float] = (0, 0)) -> np.ndarray:
    return cv2.cvtColor(Place(seed).picture(0, offset), cv2.COLOR_BGR2GRAY)


def test_a_match_ignores_light_and_knows_strangers() -> None:
    picture, meter = gray(1), MotionMeter()
    darker = (0.6 * picture + 20).astype(np.uint8)
    same = meter(picture, picture).match  # below 1 where the picture is flat
    assert same > 0.6
    assert meter(picture, darker).match > 0.85 * same
    assert abs(meter(picture, gray(2)).match) < 0.2


@pytest.mark.parametrize("shift_px", [2.0, 5.0])
def test_motion_between_neighbours_is_the_cameras_shift(shift_px: float) -> None:
    before, after = (cv2.cvtColor(marbled(at), cv2.COLOR_BGR2GRAY) for at in (0.0, shift_px))
    motion = MotionMeter()(before, after)
    assert motion.match > 0.8
    assert motion.flow * WIDTH == pytest.approx(shift_px, rel=0.15)  # flow at the picture's edge is a guess


@pytest.mark.parametrize("offset", [(0.0, 0.0), (25.0, -6.0), (40.0, 8.0)])
def test_a_place_is_recognised_with_its_displacement(offset: tuple[float, float]) -> None:
    recogniser, (first, second) = PlaceRecogniser(), (gray(4), gray(4, offset))
    found = recogniser.similarity(recogniser.features(first), recogniser.features(second))
    assert found is not None
    assert mean_shift(found, first.shape) * WIDTH == pytest.approx(np.hypot(*offset), abs=1.5)


def test_another_place_and_an_empty_picture_are_not_recognised() -> None:
    recogniser = PlaceRecogniser()
    here, there, nothing = (recogniser.features(g) for g in (gray(5), gray(6), np.full((HEIGHT, WIDTH), 90, np.uint8)))
    assert recogniser.similarity(here, there) is None
    assert recogniser.similarity(here, nothing) is None


def test_one_poster_in_two_places_does_not_make_them_one() -> None:
    noise = np.random.default_rng(0).integers(0, 255, (3, HEIGHT, WIDTH), np.uint8)
    here, there, elsewhere = (cv2.GaussianBlur(one, (0, 0), 1.5) for one in noise)
    here[5:95, 20:75] = there[5:95, 30:85] = elsewhere[5:95, 20:75]
    recogniser = PlaceRecogniser()
    first, second = recogniser.features(here), recogniser.features(there)
    here_px, there_px = recogniser._matches(first, second)
    agreeing = np.linalg.norm(there_px - here_px - [10, 0], axis=1) < 0.02 * WIDTH
    assert 10 <= agreeing.sum() <= len(agreeing)  # its features agree
    assert recogniser.similarity(first, second) is None


def test_a_colour_histogram_counts_pixels() -> None:
    hsv = np.zeros((10, 10, 3), np.uint8)
    hsv[:3] = (90, 200, 200)
    histogram = color_histogram(hsv)
    assert sorted(histogram[histogram > 0].tolist()) == pytest.approx([0.3, 0.7])
