"""Entries of the golden set: boxes between the rows, and what an entry must have."""

import numpy as np
import pytest
from pydantic import ValidationError

from humanmm.models.benchmark.expectations import ExpectedPerson, GoldenClip, Part, marked


def test_a_box_is_interpolated_between_rows_constant_outside_and_unknown_where_nobody_is_in_view() -> None:
    person = ExpectedPerson(
        who="man", frames=((2, 6),), maybe=((8, 9),), at=((2, 0.0, 0.0, 0.4, 1.0), (4, 0.2, 0.0, 0.6, 1.0))
    )
    boxes = person.boxes(10)
    np.testing.assert_allclose(boxes[3], [0.1, 0, 0.5, 1])
    np.testing.assert_allclose(boxes[8], [0.2, 0, 0.6, 1])
    assert np.flatnonzero(np.isnan(boxes[:, 0])).tolist() == [0, 1, 6, 7, 9]
    assert np.flatnonzero(person.required(10)).tolist() == [2, 3, 4, 5]


def test_a_person_must_be_somewhere_and_rows_must_rise() -> None:
    with pytest.raises(ValidationError, match="`frames` or `maybe` is needed"):
        ExpectedPerson(who="man", at=((0, 0, 0, 1, 1),))
    with pytest.raises(ValidationError, match="must rise"):
        ExpectedPerson(who="man", frames=((0, 9),), at=((4, 0, 0, 1, 1), (4, 0, 0, 1, 1)))
    with pytest.raises(ValidationError, match="a crowd has `maybe` only"):
        ExpectedPerson(who="all", frames=((0, 9),), crowd=True, at=((0, 0, 0, 1, 1),))


def test_a_clip_is_cut_unless_it_is_a_whole_video() -> None:
    assert not GoldenClip(name="whole", shows="", parts=(Part(video="a.mp4"),)).is_cut
    assert GoldenClip(name="piece", shows="", parts=(Part(video="a.mp4", frames=(0, 9)),)).is_cut
    assert GoldenClip(name="two", shows="", parts=(Part(video="a.mp4"), Part(video="b.mp4"))).is_cut


def test_spans_exclude_their_end() -> None:
    assert np.flatnonzero(marked(((1, 3), (4, 5)), 6)).tolist() == [1, 2, 4]
