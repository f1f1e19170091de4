"""The pose error that a fit is expected to have grows with its distance from what the lifter says."""

import numpy as np
import pytest

from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.fit.pose_error import FACTOR, POWER, expected_error_m

BODY = np.random.default_rng(0).normal(0, 0.3, (1, 33, 3))


def test_it_grows_with_the_distance_and_not_with_place_size_or_axes() -> None:
    noise = np.random.default_rng(1).normal(size=(1, 33, 3))
    near, far = (expected_error_m(BODY + spread * noise, BODY)[0] for spread in (0.01, 0.1))
    assert near < far
    elsewhere = 1.3 * (BODY @ rotvec_to_rotmat(np.array([0.3, -1.0, 0.5])).T) + [0.0, 1.0, 4.0]
    assert expected_error_m(BODY + 0.1 * noise, elsewhere)[0] == pytest.approx(far)


def test_a_distance_of_60_mm_is_that_of_a_usual_pose() -> None:
    moved = BODY.copy()
    moved[0, 11:29] += np.random.default_rng(2).normal(0, 0.045, (18, 3))
    assert 0.05 < expected_error_m(moved, BODY)[0] < 0.1
    assert pytest.approx(0.0887, abs=0.001) == FACTOR * 0.06**POWER
