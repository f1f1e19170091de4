"""Routines: as long as asked, on the floor, free flight, feet that stand, and the same for the same seed."""

import numpy as np
import pytest

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.records.recording import CONTACT_JOINTS
from humanmm.models.synthetic.choreography import FASTEST_MS, GUARD, KINDS, RATE_HZ, choreography, mirrored
from humanmm.models.synthetic.mocap import MocapSequence


def joints_of(sequence: MocapSequence) -> np.ndarray:
    rest = load_body().rest_joints(np.zeros(10))
    joints, _ = forward_kinematics(rest, sequence.R_world_root, sequence.body_pose, sequence.pelvis)
    return joints


@pytest.fixture(scope="module", params=KINDS)
def routine(request: pytest.FixtureRequest) -> MocapSequence:
    return choreography(request.param, request.param, 4.0, np.random.default_rng(3))


def test_it_is_as_long_as_requested_and_stays_on_the_floor(routine: MocapSequence) -> None:
    assert routine.num_frames / RATE_HZ >= 4.0
    lowest = joints_of(routine)[..., 2].min(axis=1)
    assert lowest.min() > -0.06
    if routine.name not in ("jump", "spin"):
        assert lowest.max() < 0.2


def test_feet_in_contact_stand_and_nobody_slides_away(routine: MocapSequence) -> None:
    feet = joints_of(routine)[:, list(CONTACT_JOINTS)]
    speed = np.linalg.norm(np.diff(feet, axis=0), axis=-1) * RATE_HZ
    standing = (routine.contacts[1:] > 0.5) & (routine.contacts[:-1] > 0.5)
    if standing.any():
        assert np.median(speed[standing]) < 0.15
    pelvis = np.linalg.norm(np.diff(routine.pelvis[:, :2], axis=0), axis=-1) * RATE_HZ
    assert pelvis.max() < 1.2 * FASTEST_MS


def test_in_the_air_the_body_falls() -> None:
    jump = choreography("jump", "jump", 6.0, np.random.default_rng(0))
    lowest = joints_of(jump)[..., 2].min(axis=1)
    highest = int(np.argmax(lowest))
    assert lowest[highest] > 0.1
    window = lowest[highest - 5 : highest + 6]
    fall = np.polyfit(np.arange(-5, 6) / RATE_HZ, window, 2)[0] * 2
    assert -25 < fall < -3


def test_the_same_seed_gives_the_same_routine_and_another_one_another() -> None:
    one, same, other = (choreography("dance", "d", 3.0, np.random.default_rng(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.body_pose, same.body_pose)
    assert one.body_pose.shape != other.body_pose.shape or not np.allclose(one.body_pose, other.body_pose)


def test_a_posture_mirrored_twice_is_itself() -> None:
    assert mirrored(mirrored(GUARD)) == GUARD
    assert mirrored(GUARD) != GUARD
