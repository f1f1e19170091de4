"""Colours can be told apart, and shading runs from dark to light."""

from dataclasses import replace
from itertools import pairwise

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


@pytest.mark.parametrize("color", palette.PEOPLE)
def test_a_ramp_brightens_from_shades_of_the_colour_to_beyond_it(color: palette.RGB) -> None:
    ramp = palette.shading_ramp(color).astype(int)
    assert (np.diff(ramp, axis=0) >= 0).all()
    half_lit = 128
    np.testing.assert_allclose(ramp[half_lit], np.array(color) * (0.16 + half_lit / 255), atol=1)
    assert (ramp[-1] >= color).all()
