"""Clothing colours."""

import numpy as np
import pytest

from humanmm.models.perception.clothing import (
    GROUND,
    PARTS,
    clothing_histogram,
    colour_distance,
    mean_colours,
    part_colours,
)
from humanmm.models.perception.observation import Observation
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import Region
from humanmm.models.records.landmarks import HIPS, INDEX, SHOULDERS
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


def whole_person() -> Observation:
    """A person of 100 pixels on a mask that holds more than him: every limb straight down, feet to the side."""
    region = Region(100.0, 100.0, 128.0)
    keypoints = np.ones((33, 3))
    for name, x, y in (("ear", 3, 56), ("shoulder", 10, 66), ("elbow", 14, 82), ("wrist", 14, 96), ("hip", 6, 98),
                       ("knee", 6, 120), ("ankle", 6, 142), ("heel", 6, 144), ("foot_index", 14, 144)):  # fmt: skip
        for side, sign in (("left", 1), ("right", -1)):
            keypoints[INDEX[f"{side}_{name}"], :2] = 100 + sign * x, y
    keypoints[INDEX["nose"], :2] = 100, 57
    mask = np.zeros((128, 128), np.uint8)
    mask[10:112, 40:88] = 1
    landmarks3d = (keypoints - [100, 98, 1]) * [0.017, 0.017, 0]
    return Observation(keypoints, landmarks3d, np.array([76, 46, 124, 148.0]), 0.9, mask, region, region)


def test_every_part_of_the_body_and_the_ground_have_their_colours() -> None:
    found = part_colours(dressed(RED, BLUE), whole_person())
    red, blue = found[PARTS.index("chest")], found[PARTS.index("shanks")]
    assert red[1] > 40 and red[2] > 20  # CIE a* of red, b* of yellow
    assert blue[2] < -40
    for part, colour in (("hair", red), ("belly", red), ("upper arms", red), ("thighs", blue), ("feet", blue)):
        np.testing.assert_allclose(found[PARTS.index(part)], colour, atol=3)
    np.testing.assert_allclose(found[GROUND], blue, atol=3)


def test_what_is_not_seen_of_a_body_has_no_colour() -> None:
    person = whole_person()
    legs = [INDEX[f"{side}_{name}"] for side in ("left", "right") for name in ("knee", "ankle", "heel", "foot_index")]
    person.keypoints[legs, 2] = 0.1
    found = part_colours(dressed(RED, BLUE), person)
    hidden = [PARTS.index("thighs"), PARTS.index("shanks"), PARTS.index("feet"), GROUND]
    assert np.isnan(found[hidden]).all()
    assert np.isfinite(np.delete(found, hidden, axis=0)).all()
