"""Half-open intervals of frames."""

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from humanmm.models.geometry.intervals import frame_intervals, in_intervals, merged, runs_of_true

intervals = st.lists(st.tuples(st.integers(0, 60), st.integers(1, 9)).map(lambda pair: (pair[0], pair[0] + pair[1])))


@given(st.lists(st.booleans()))
def test_runs_of_true_cover_exactly_the_true_and_never_touch(flags: list[bool]) -> None:
    holds = np.array(flags, bool)
    runs = runs_of_true(holds)
    np.testing.assert_array_equal(in_intervals(np.arange(len(holds)), runs), holds)
    assert all(run.end < following.start for run, following in pairwise(runs))


@given(intervals, st.integers(0, 3))
def test_merged_intervals_cover_the_same_frames_and_short_gaps(many: list[tuple[int, int]], gap: int) -> None:
    frame = np.arange(80)
    covered, union = in_intervals(frame, many), merged(many, gap=gap)
    inside = in_intervals(frame, union)
    assert (inside >= covered).all()
    uncovered = runs_of_true(inside & ~covered)
    assert all(end - start <= gap for start, end in uncovered)
    assert all(following.start - one.end > gap for one, following in pairwise(union))


def test_a_hole_between_marked_frames_belongs_to_their_interval_and_one_after_them_does_too() -> None:
    frame = np.array([3, 4, 8, 9, 20])
    assert frame_intervals(frame, np.array([False, True, True, False, True])) == ((4, 9), (20, 21))
    assert frame_intervals(frame[:0], np.zeros(0, bool)) == ()
