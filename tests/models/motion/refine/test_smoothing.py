"""The smoother: what it leaves alone, what it removes, and how it fills gaps."""

import numpy as np
import pytest

from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.motion.refine.smoothing import smooth, smooth_rotations


def sine(hz: float, fps: float, seconds: float = 4.0) -> tuple[np.ndarray, np.ndarray]:
    time = np.arange(round(seconds * fps)) / fps
    return np.sin(2 * np.pi * hz * time)[:, None], time


@pytest.mark.parametrize("fps", [30.0, 60.0, 120.0])
@pytest.mark.parametrize(("hz", "expected"), [(2.0, 1.0), (8.0, 0.5), (12.0, 0.1)])
def test_the_band_limit_is_the_same_at_every_frame_rate(fps: float, hz: float, expected: float) -> None:
    values, time = sine(hz, fps)
    smoothed = smooth(values, np.ones(len(time)), time, cutoff_hz=8.0)
    middle = slice(len(time) // 4, -len(time) // 4)
    gain = np.dot(smoothed[middle, 0], values[middle, 0]) / np.dot(values[middle, 0], values[middle, 0])
    assert gain == pytest.approx(expected, abs=0.09)  # a third difference at 12 of 15 Hz is no derivative any more


def test_steady_acceleration_passes_unchanged_also_at_uneven_times() -> None:
    time = np.cumsum(np.random.default_rng(0).uniform(0.02, 0.06, 80))
    values = np.stack([3 * time**2 - time, 0.2 * time], axis=1)
    np.testing.assert_allclose(smooth(values, np.ones(80), time, cutoff_hz=4.0), values, atol=1e-8)


def test_a_short_gap_carries_the_motion_on() -> None:
    values, time = sine(0.5, 30.0)
    weight = np.ones(len(time))
    weight[40:46] = 0.0
    broken = np.where(weight[:, None] > 0, values, 99.0)
    assert np.abs(smooth(broken, weight, time, cutoff_hz=8.0) - values).max() < 0.01


def test_a_long_gap_is_crossed_without_a_swing() -> None:
    time = np.arange(150) / 30
    values = np.where(time < 1.0, time, 0.0)[:, None] + np.where(time > 4.0, 2.0 - (time - 4.0), 0.0)[:, None]
    weight = ((time < 1.0) | (time > 4.0)).astype(float)
    filled = smooth(values, weight, time, cutoff_hz=8.0)
    assert filled.max() < 2.3
    assert filled.min() > -0.05
    assert np.abs(np.diff(filled, axis=0)).max() < 0.06


def test_nothing_known_is_left_as_it_is() -> None:
    values = np.arange(12.0).reshape(6, 2)
    np.testing.assert_array_equal(smooth(values, np.zeros(6), np.arange(6.0), cutoff_hz=8.0), values)


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_a_handful_of_frames_is_smoothed_too(count: int) -> None:
    values = np.ones((count, 3))
    np.testing.assert_allclose(smooth(values, np.ones(count), np.arange(count) / 30, cutoff_hz=8.0), values)


def test_a_steady_rotation_passes_unchanged_through_several_revolutions() -> None:
    time = np.arange(120) / 30
    R = rotvec_to_rotmat(time[:, None, None] * [0.0, 5.0, 0.0])
    smoothed = rotvec_to_rotmat(smooth_rotations(rotmat_to_rotvec(R), np.ones(120), time, cutoff_hz=8.0))
    assert np.abs(rotmat_to_rotvec(np.swapaxes(smoothed, -1, -2) @ R)).max() < 1e-3


def test_noise_of_rotations_is_reduced_and_a_gap_bridged() -> None:
    time = np.arange(90) / 30
    rng = np.random.default_rng(1)
    truth = rotvec_to_rotmat(np.sin(2 * time)[:, None, None] * np.array([[0.5, 0.2, 0.0], [0.0, 0.0, 1.0]]))
    noisy = truth @ rotvec_to_rotmat(0.05 * rng.normal(size=(90, 2, 3)))
    weight = np.ones(90)
    weight[30:36] = 0.0
    noisy[30:36] = np.eye(3)
    smoothed = rotvec_to_rotmat(smooth_rotations(rotmat_to_rotvec(noisy), weight, time, cutoff_hz=4.0))
    error = np.linalg.norm(rotmat_to_rotvec(np.swapaxes(smoothed, -1, -2) @ truth), axis=-1)
    assert error.mean() < 0.05
    assert error[30:36].max() < 0.2
