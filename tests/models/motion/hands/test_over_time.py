"""Looks become frames: what was seen is kept, what was not is at ease, whatever the frame rate."""

import numpy as np
import pytest

from humanmm.models.motion.hands.over_time import FADE_S, HOLD_S, over_time

EASE = np.array([0.2, -0.1])


def test_steady_looks_give_their_values_with_their_confidence() -> None:
    look_s = np.arange(0, 2, 1 / 15)
    values, certain = over_time(np.arange(0, 1.9, 1 / 60), look_s, np.tile([1.0, 2.0], (30, 1)), np.full(30, 0.8), EASE)
    np.testing.assert_allclose(values, np.tile([1.0, 2.0], (len(values), 1)))
    np.testing.assert_allclose(certain, 0.8)


def test_where_nobody_saw_the_hand_it_is_at_ease_with_confidence_zero() -> None:
    look_s, time_s = np.arange(0, 3, 1 / 15), np.arange(0, 3, 1 / 30)
    confidence = np.where((look_s > 1) & (look_s < 2), 0.0, 0.9)
    values, certain = over_time(time_s, look_s, np.ones((45, 2)), confidence, EASE)
    hidden = (time_s > 1 + HOLD_S + FADE_S) & (time_s < 2 - HOLD_S - FADE_S)
    np.testing.assert_array_equal(values[hidden], np.tile(EASE, (hidden.sum(), 1)))
    assert not certain[hidden].any()
    assert np.abs(np.diff(values, axis=0)).max() < 0.25  # it gets there without a jump


def test_a_look_that_was_none_says_nothing() -> None:
    look_s = np.arange(0, 1, 1 / 30)
    confidence = np.where(np.arange(30) % 2, np.nan, 0.9)
    values, certain = over_time(
        look_s, look_s, np.where(np.arange(30)[:, None] % 2, 99.0, 1.0) * [1, 1], confidence, EASE
    )
    assert values.max() < 1.1
    np.testing.assert_allclose(certain, 0.9)


@pytest.mark.parametrize("rate_hz", [12, 24, 60])
def test_a_slow_motion_survives_at_any_rate(rate_hz: int) -> None:
    look_s = np.arange(0, 4, 1 / 15)
    motion = np.sin(2 * np.pi * 0.5 * look_s)[:, None]
    time_s = np.arange(0.5, 3.5, 1 / rate_hz)
    values, _ = over_time(time_s, look_s, motion, np.full(len(look_s), 1.0), np.zeros(1))
    assert np.abs(values[:, 0] - np.sin(2 * np.pi * 0.5 * time_s)).max() < 0.2


def test_without_any_look_everything_is_at_ease() -> None:
    values, certain = over_time(np.arange(3.0), np.zeros(0), np.zeros((0, 2)), np.zeros(0), EASE)
    np.testing.assert_array_equal(values, np.tile(EASE, (3, 1)))
    assert not certain.any()
