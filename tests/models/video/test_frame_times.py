"""Frames and seconds of constant and variable rates."""

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from humanmm.models.video.frame_times import LONG_GAP_S, elapsed_s, long_gap_s, nearest_frame, sampled_every, shown_s

irregular = st.lists(st.floats(0.002, 0.3), min_size=1, max_size=40).map(lambda steps: np.cumsum([1.5, *steps]))


@pytest.mark.parametrize("rate_hz", [Fraction(24000, 1001), 24, 25, Fraction(30000, 1001), 30, 50, 60])
@pytest.mark.parametrize("period_s", [0.1, 0.33])
def test_at_a_constant_rate_a_sample_comes_every_rounded_number_of_frames(rate_hz: Fraction, period_s: float) -> None:
    time_s = 7.0 + np.arange(300) / float(rate_hz)
    step = round(period_s * float(rate_hz))
    np.testing.assert_array_equal(np.flatnonzero(sampled_every(time_s, period_s)), np.arange(0, 300, step))


@given(irregular, st.floats(0.01, 0.5))
def test_each_sample_is_the_frame_nearest_to_a_period_after_the_one_before(time_s: np.ndarray, period_s: float) -> None:
    samples = np.flatnonzero(sampled_every(time_s, period_s))
    assert samples[0] == 0
    for one, following in pairwise(samples):
        off = np.abs(time_s[one + 1 :] - time_s[one] - period_s)
        assert off[following - one - 1] <= off.min() + 1e-6


@given(irregular, st.floats(0, 14))
def test_the_nearest_frame_is_nearest(time_s: np.ndarray, moment_s: float) -> None:
    off = np.abs(time_s - moment_s)
    assert off[nearest_frame(time_s, moment_s)] <= off.min() + 1e-6


@given(irregular)
def test_frames_are_shown_until_the_next(time_s: np.ndarray) -> None:
    shown = shown_s(time_s, np.arange(len(time_s)))
    np.testing.assert_allclose(shown[:-1].sum(), time_s[-1] - time_s[0])
    assert shown[-1] == shown[-2]


def test_thirty_frames_at_30_hz_are_exactly_a_second() -> None:
    time_s = np.arange(3000) / 30 + 1 / 7
    assert {elapsed_s(time_s, k, k + 30) for k in range(2900)} == {1.0}


def test_a_gap_is_long_by_the_rate_of_the_video_and_never_beyond_the_limit_for_all() -> None:
    assert long_gap_s(np.arange(50) / 30) == 1.0
    assert long_gap_s(np.arange(50) / 5) == pytest.approx(2.0)
    assert long_gap_s(np.arange(50) * 2.0) == LONG_GAP_S
    assert long_gap_s(np.cumsum([0.04, 0.04, 0.4] * 10)) == LONG_GAP_S, "the rate varies"
