"""Colours can be told apart, and shading runs from dark to light."""

from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import pytest

from humanmm.models.drawing import palette
from humanmm.models.records.recording import Recording


def test_numbers_beyond_the_palette_begin_again_and_neighbours_differ_and_who_may_be_nobody_is_grey(
    standing: Recording,
) -> None:
    first = standing.people[0]
    again = replace(first, person=len(palette.PEOPLE))
    assert palette.person_color(again) == palette.person_color(first)
    assert palette.person_color(replace(first, probability=0.4)) == palette.NOT_OBSERVED
    colors = [palette.shot_color(k) for k in range(12)]
    assert all(one != other for one, other in pairwise(colors))


LMS = np.array([[0.4122, 0.5363, 0.0514], [0.2119, 0.6807, 0.1074], [0.0883, 0.2817, 0.63]])
OKLAB = np.array([[0.2105, 0.7936, -0.0041], [1.978, -2.4286, 0.4506], [0.0259, 0.7828, -0.8087]])
"""Ottosson, "A perceptual color space for image processing"."""
EYES = {
    "all cones": np.eye(3),
    "no red": np.array([[0.1523, 1.0526, -0.2049], [0.1145, 0.7863, 0.0992], [-0.0039, -0.0481, 1.052]]),
    "no green": np.array([[0.3673, 0.8606, -0.228], [0.2801, 0.6725, 0.0474], [-0.0118, 0.0429, 0.969]]),
}
"""Machado et al. 2009, "A physiologically-based model for simulation of color vision deficiency", severity 1."""


def _linear(colors: object) -> np.ndarray:
    value = np.asarray(colors, float) / 255
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def _oklab(colors: object, eyes: str) -> np.ndarray:
    seen = np.clip(_linear(colors) @ EYES[eyes].T, 0, 1)
    return np.asarray(np.cbrt(seen @ LMS.T) @ OKLAB.T)


@pytest.mark.parametrize(("eyes", "apart"), [("all cones", 0.13), ("no red", 0.085), ("no green", 0.085)])
def test_twelve_people_have_colours_that_can_be_told_apart(eyes: str, apart: float) -> None:
    assert len(palette.PEOPLE) == 12
    for one, other in combinations(_oklab(palette.PEOPLE, eyes), 2):
        assert np.linalg.norm(one - other) > apart


def test_nobody_has_a_colour_like_that_of_contacts_cuts_or_the_unseen() -> None:
    marks = _oklab([palette.CONTACT, palette.CUT, palette.NOT_OBSERVED], "all cones")
    for color in _oklab(palette.PEOPLE, "all cones"):
        assert np.linalg.norm(marks - color, axis=-1).min() > 0.09


@pytest.mark.parametrize("color", palette.PEOPLE)
def test_a_person_is_visible_on_white_and_on_a_dark_page(color: palette.RGB) -> None:
    weights = np.array([0.2126, 0.7152, 0.0722])  # WCAG 2.1, relative luminance
    light, dark = _linear(color) @ weights + 0.05, _linear((25, 29, 35)) @ weights + 0.05
    assert 1.05 / light > 1.5 and light / dark > 2.9


@pytest.mark.parametrize("color", palette.PEOPLE)
def test_a_ramp_brightens_from_shades_of_the_colour_to_beyond_it(color: palette.RGB) -> None:
    ramp = palette.shading_ramp(color).astype(int)
    assert (np.diff(ramp, axis=0) >= 0).all()
    half_lit = 128
    np.testing.assert_allclose(ramp[half_lit], np.array(color) * (0.16 + half_lit / 255), atol=1)
    assert (ramp[-1] >= color).all()
