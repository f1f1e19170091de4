"""Whether two looks show one person."""

import numpy as np

from humanmm.models.perception.appearance import (
    GROUND_UNKNOWN,
    ground_distance,
    median_parts,
    part_distance,
    same_look_odds,
)
from humanmm.models.perception.clothing import HISTOGRAM_BINS

DARK = np.eye(HISTOGRAM_BINS)[37]


def body_colours(seed: int = 0) -> np.ndarray:
    """L*a*b* of the parts and of the ground of somebody in many colours."""
    return np.random.default_rng(seed).uniform([10, -40, -40], [90, 40, 40], (9, 3))


def test_the_light_may_change_between_two_shots_but_not_the_clothes() -> None:
    one, another = body_colours(), body_colours(1)
    same = one + np.array([10, 3, -3]) + np.random.default_rng(2).normal(0, 2, one.shape)
    assert part_distance(one, same) < -0.5 < 0 < part_distance(one, another)


def test_two_people_in_black_are_less_likely_one_than_two_in_the_same_colours() -> None:
    noise = np.random.default_rng(0).normal(0, 3, (9, 3))
    black, colourful = np.full((9, 3), [10.0, 0.0, 0.0]), body_colours()
    assert part_distance(black, black + noise) > part_distance(colourful, colourful + noise) + 0.5


def test_few_parts_say_less_and_too_few_nothing() -> None:
    one = body_colours()
    few, fewer = one.copy(), one.copy()
    few[3:8], fewer[2:8] = np.nan, np.nan
    assert part_distance(one, one) < part_distance(one, few) < 0
    assert part_distance(one, fewer) is None


def test_another_ground_speaks_against_one_person_and_an_unseen_one_says_nothing() -> None:
    grass, carpet, unseen = (np.full((9, 3), colour) for colour in ([50.0, -30, 30], [50.0, 10, 0], [np.nan] * 3))
    assert ground_distance(grass, grass) == 0
    assert ground_distance(grass, unseen) == GROUND_UNKNOWN < ground_distance(grass, carpet)


def test_a_part_is_the_median_of_the_samples_that_show_it() -> None:
    first, second = body_colours(), body_colours(1)
    second[2] = np.nan
    between = median_parts([first, second])
    np.testing.assert_allclose(between[2], first[2])
    np.testing.assert_allclose(between[0], (first[0] + second[0]) / 2)
    assert np.isnan(median_parts([])).all()


def test_parts_tell_two_people_apart_whose_clothes_are_of_one_colour() -> None:
    one, other = np.full((9, 3), [15.0, 0.0, 0.0]), np.full((9, 3), [15.0, 0.0, 0.0])
    one[0], other[0] = [70, 5, 30], [10, 2, 2]  # fair and black hair
    one[4], other[4], other[6], other[7] = [65, 12, 15], [20, 0, 0], [60, 10, 12], [80, 0, 0]  # forearms, shanks, shoes
    unseen = np.full((9, 3), np.nan)
    assert same_look_odds(DARK, one, DARK, other) < 0 < same_look_odds(DARK, one, DARK, one)
    assert same_look_odds(DARK, unseen, DARK, unseen) > 0
