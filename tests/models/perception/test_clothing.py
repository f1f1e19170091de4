"""Clothing colours."""

import numpy as np
import pytest

from humanmm.models.perception.clothing import clothing_histogram, colour_distance, mean_colours
from humanmm.models.perception.observation import Observation
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import Region
from humanmm.models.records.landmarks import HIPS, SHOULDERS
from humanmm.models.video.colors import Colors

RED, BLUE = (220, 30, 30), (30, 30, 220)


def person() -> Observation:
    region = Region(100.0, 100.0, 128.0)
    keypoints = np.zeros((33, 3))
    keypoints[list(SHOULDERS)], keypoints[list(HIPS)] = (100, 60, 1), (100, 100, 1)
    mask = np.zeros((128, 128), np.uint8)
    mask[20:110, 50:78] = 1
    return Observation(keypoints, np.zeros((33, 3)), np.array([86, 56, 114, 146.0]), 0.9, mask, region, region)


def dressed(top: tuple[int, int, int], trousers: tuple[int, int, int]) -> Picture:
    """A picture all of one colour above the hips and of another below them."""
    rgb = np.empty((200, 200, 3), np.uint8)
    rgb[:100], rgb[100:] = top, trousers
    samples = Colors().samples(rgb)
    return Picture((samples[..., 0], samples[::2, ::2, 1], samples[::2, ::2, 2]))


def test_each_half_of_the_body_has_its_own_colour() -> None:
    both = clothing_histogram(dressed(RED, BLUE), person())
    top, trousers = np.split(both, 2)
    assert both.sum() == pytest.approx(1)
    assert top.max() > 0.45 and trousers.max() > 0.45  # chroma mixes where the halves meet
    assert top.argmax() != trousers.argmax()


def test_the_distance_is_zero_for_equal_clothes_and_one_for_nothing_in_common() -> None:
    one, other = clothing_histogram(dressed(RED, BLUE), person()), clothing_histogram(dressed(BLUE, RED), person())
    assert colour_distance(one, one) < 1e-6
    assert colour_distance(one, other) > 0.9
    # half of the mass in common: √(1 − ½)
    assert colour_distance(np.array([0.5, 0.5, 0.0]), np.array([0.5, 0.0, 0.5])) == pytest.approx(np.sqrt(0.5))


def test_a_mean_of_histograms_sums_to_one() -> None:
    samples = np.random.default_rng(0).random((5, 12))
    np.testing.assert_allclose(mean_colours(samples), samples.sum(axis=0) / samples.sum())
    assert not mean_colours(np.zeros((2, 12))).any()
