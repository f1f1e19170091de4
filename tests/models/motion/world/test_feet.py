"""Feet: which stand, how far they are believed, where they put the floor."""

from dataclasses import replace

import numpy as np
import pytest
from walker import EDGE, FPS, scene, stride

from humanmm.models.geometry.rotations import unit
from humanmm.models.motion.world.feet import hold, put_on_floor
from humanmm.models.motion.world.problem import ShotRig, ShotTrajectory
from humanmm.models.motion.world.solver import solve
from humanmm.models.motion.world.state import SolveSettings, WorldState


def test_contacts_are_where_the_feet_stand() -> None:
    trajectories, rigs, _ = scene()
    contacts = np.concatenate(solve(trajectories, rigs, [EDGE]).contacts)
    part = (np.arange(60) / FPS) % 1.0
    standing, swinging = (part > 0.1) & (part < 0.4), (part > 0.65) & (part < 0.85)
    assert contacts[standing, 0].min() > 0.6
    assert contacts[swinging, 0].max() < 0.3


@pytest.mark.parametrize("hz", [5.0, 8.0, 10.0, 12.0, 30.0])
def test_who_stands_still_stands_at_every_frame_rate_but_not_over_a_hole(hz: float) -> None:
    frame = np.concatenate([np.arange(20), 24 + np.arange(20)])
    n, pelvis = len(frame), np.array([0.0, 5.0, -0.5])
    feet = np.array([[x, y, -0.9] for x in (0.1, -0.1) for y in (-0.05, 0.15)])
    stands = ShotTrajectory(
        0,
        0,
        frame,
        frame / hz,
        np.tile(pelvis, (n, 1)),
        np.tile(feet, (n, 1, 1)),
        np.ones(n),
        np.tile(unit(pelvis), (n, 1)),
    )
    rig = ShotRig(np.zeros((44, 3)), 0, 1.0, scale_known=True)
    state = WorldState([stands.offset], np.eye(3)[None], np.zeros((1, 3)), np.ones(1), np.zeros(1), 0.0)
    still, _, _ = hold(stands, rig, state, 0, SolveSettings())
    np.testing.assert_allclose(np.delete(still, 19, axis=0), 1.0)
    np.testing.assert_array_equal(still[19], 0.0)


def test_legs_that_swing_too_little_do_not_hold_back_who_comes_toward_the_camera() -> None:
    pelvis, feet = stride(30)
    rows, camera = np.arange(30), np.array([4.0, 0.0, 1.4])
    swing_lost = feet * np.array([0.5, 1.0, 1.0])  # he walks along x, the line of sight
    offset = pelvis - camera
    seen = ShotTrajectory(0, 0, rows, rows / FPS, offset, swing_lost, np.ones(30), unit(offset))
    found = solve([seen], [ShotRig(np.zeros((30, 3)), 0, 1.0, scale_known=True)], []).pelvis[0]
    # Feet that were believed along the line of sight as across it would leave 0.64 of the way.
    assert np.ptp(found[:, 0]) > 0.85 * np.ptp(pelvis[:, 0])


def test_every_shot_is_put_on_the_floor_by_the_feet_that_stand_in_it() -> None:
    trajectories, rigs, pelvis = scene()
    high = [replace(one, offset=one.offset + np.array([0.0, 0.0, 0.3 * (k + 1)])) for k, one in enumerate(trajectories)]
    state = WorldState(
        pelvis=[pelvis[one.frame] + np.array([0.0, 0.0, 0.3 * (k + 1)]) for k, one in enumerate(high)],
        rotation=np.tile(np.eye(3), (2, 1, 1)),
        origin=np.array([[0.0, 0.0, 0.3], [0.0, 0.0, 0.6]]),
        scale=np.ones(2),
        log_size=np.zeros(1),
        log_focal=0.0,
    )
    down = put_on_floor(high, rigs, state, SolveSettings())
    for one, moved in zip(high, down.pelvis, strict=True):
        np.testing.assert_allclose(moved, pelvis[one.frame], atol=1e-6)
    np.testing.assert_allclose(down.origin, 0.0, atol=1e-6)
