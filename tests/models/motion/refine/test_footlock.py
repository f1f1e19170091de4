"""Foot locking on a simple leg: planted feet stand, nothing pops, knees bend the right way."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import compose
from humanmm.models.geometry.rotations import angle_between_deg, rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.motion.fit.state import LongMotion, Skeleton
from humanmm.models.motion.refine.footlock import (
    LEGS,
    Leg,
    LockSettings,
    ankle_targets,
    bend_leg,
    contact_positions,
    lock_feet,
)
from humanmm.models.records.recording import CONTACT_JOINTS

SOLE = np.array([0.08, 0.03])
N = 60
TIME = np.arange(N) / 30


def make_leg(hip: np.ndarray, flexion: np.ndarray) -> Leg:
    """A leg of 0.42 + 0.40 m whose thigh swings forward by `flexion` and whose knee bends back by twice that.

    World: z up, the body faces +y, x to its left is +x (thigh down along −z in the rest pose; axes of the world).
    """
    R_hip = rotvec_to_rotmat(np.stack([flexion, 0 * flexion, 0 * flexion], axis=1))
    R_knee = R_hip @ rotvec_to_rotmat(np.stack([-2 * flexion, 0 * flexion, 0 * flexion], axis=1))
    R_foot = np.tile(np.eye(3), (len(hip), 1, 1))
    knee = hip + R_hip @ [0.0, 0.0, -0.42]
    ankle = knee + R_knee @ [0.0, 0.0, -0.40]
    toe = ankle + R_foot @ np.array([0.0, 0.15, -0.05])
    return Leg(hip, knee, ankle, toe, np.tile(np.eye(3), (len(hip), 1, 1)), R_hip, R_knee, R_foot)


def sliding_leg(bent: float = 0.25) -> Leg:
    """Stands, but drifts 6 cm to the side in two seconds and trembles a little."""
    wobble = 0.01 * np.sin(2 * np.pi * 1.3 * TIME)
    hip = np.stack([0.03 * TIME, wobble, np.full(N, 0.87) + 0.3 * wobble], axis=1)
    return make_leg(hip, np.full(N, bent))


def posed(leg: Leg, target: np.ndarray, R_foot: np.ndarray) -> Leg:
    """Forward kinematics of what `bend_leg` returns."""
    hip_local, knee_local, ankle_local = bend_leg(leg, target, R_foot)
    R_hip = leg.R_pelvis @ hip_local
    R_knee = R_hip @ knee_local
    R_ankle = R_knee @ ankle_local
    thigh = np.einsum("nba,nb->na", leg.R_hip, leg.knee - leg.hip)
    shin = np.einsum("nba,nb->na", leg.R_knee, leg.ankle - leg.knee)
    foot = np.einsum("nba,nb->na", leg.R_ankle, leg.toe - leg.ankle)
    knee = leg.hip + np.einsum("nab,nb->na", R_hip, thigh)
    ankle = knee + np.einsum("nab,nb->na", R_knee, shin)
    toe = ankle + np.einsum("nab,nb->na", R_ankle, foot)
    return replace(leg, knee=knee, ankle=ankle, toe=toe, R_hip=R_hip, R_knee=R_knee, R_ankle=R_ankle)


def locked(leg: Leg, contacts: np.ndarray) -> Leg:
    target, R_foot = ankle_targets(leg, contacts, SOLE, time_s=TIME)
    return posed(leg, target, R_foot)


def test_a_planted_foot_does_not_slide_at_all() -> None:
    leg = locked(sliding_leg(), np.ones((N, 2)))
    assert np.ptp(leg.ankle, axis=0).max() < 1e-6
    assert np.ptp(leg.toe, axis=0).max() < 1e-6


def test_a_foot_without_contact_is_left_alone() -> None:
    before = sliding_leg()
    after = locked(before, np.zeros((N, 2)))
    np.testing.assert_allclose(after.ankle, before.ankle, atol=1e-9)
    np.testing.assert_allclose(after.R_hip, before.R_hip, atol=1e-6)


def test_a_contact_begins_and_ends_without_a_pop() -> None:
    contacts = np.zeros((N, 2))
    contacts[20:40] = 1.0
    before, after = sliding_leg(), locked(sliding_leg(), contacts)
    assert np.ptp(after.ankle[20:40], axis=0).max() < 1e-6
    added = np.diff(after.ankle - before.ankle, axis=0)
    assert np.linalg.norm(added, axis=1).max() < 0.012
    np.testing.assert_allclose(after.ankle[:12], before.ankle[:12], atol=1e-3)


def test_two_contacts_close_together_hand_over_smoothly() -> None:
    contacts = np.ones((N, 2))
    contacts[30:32] = 0.0
    after = locked(sliding_leg(), contacts)
    assert np.linalg.norm(np.diff(after.ankle, axis=0), axis=1).max() < 0.03


def test_a_foot_that_turns_between_two_contacts_has_time_to() -> None:
    leg = sliding_leg()
    yaw = np.clip((TIME - 0.9) / 0.2, 0, 1)  # 57° in a fifth of a second, in the middle of which one frame is free
    R_foot = rotvec_to_rotmat(yaw[:, None] * [0.0, 0.0, 1.0])
    leg = replace(leg, R_ankle=R_foot, toe=leg.ankle + R_foot @ np.array([0.0, 0.15, -0.05]))
    contacts = np.ones((N, 2))
    contacts[30] = 0.0
    _, found = ankle_targets(leg, contacts, SOLE, time_s=TIME)
    step = np.degrees(np.linalg.norm(rotmat_to_rotvec(np.swapaxes(found[:-1], -1, -2) @ found[1:]), axis=-1))
    assert step.max() < 20, "it would be 29 if both contacts held to their last frame"
    assert step[:20].max() < 1e-3 and step[40:].max() < 1e-3
    assert angle_between_deg(found[0], found[-1]) == pytest.approx(np.degrees(1.0), abs=1)


def test_a_sole_near_the_floor_is_put_on_it_and_one_on_a_step_is_not() -> None:
    near = sliding_leg(bent=0.35)  # so that it reaches the floor
    shift = np.array([0.0, 0.0, SOLE[0] + 0.02 - np.median(near.ankle[:, 2])])
    near = replace(near, **{name: getattr(near, name) + shift for name in ("hip", "knee", "ankle", "toe")})
    lift = np.array([0.0, 0.0, 0.3])
    on_step = replace(near, **{name: getattr(near, name) + lift for name in ("hip", "knee", "ankle", "toe")})
    assert np.median(locked(near, np.ones((N, 2))).ankle[:, 2]) == pytest.approx(SOLE[0], abs=1e-6)
    assert np.median(locked(on_step, np.ones((N, 2))).ankle[:, 2]) == pytest.approx(SOLE[0] + 0.32, abs=0.01)


def test_the_heel_lifts_while_the_ball_of_the_foot_stands() -> None:
    leg = sliding_leg()
    roll = np.clip((TIME - 1.0) / 1.0, 0, 1)[:, None] * [-0.5, 0.0, 0.0]  # the foot turns about its ball
    R_foot = rotvec_to_rotmat(roll)
    toe = leg.ankle + R_foot @ np.array([0.0, 0.15, -0.05])
    leg = replace(leg, R_ankle=R_foot, toe=toe + (leg.toe - toe))
    ankle = leg.toe - R_foot @ np.array([0.0, 0.15, -0.05])
    leg = replace(leg, ankle=ankle)
    contacts = np.ones((N, 2))
    contacts[30:, 0] = 0.0
    target, R = ankle_targets(leg, contacts, SOLE, time_s=TIME)
    toes = target + np.einsum("nab,b->na", R, [0.0, 0.15, -0.05])
    assert np.ptp(toes[30:, :2], axis=0).max() < 0.005
    assert np.linalg.norm(np.diff(toes, axis=0), axis=1).max() < 0.02


def test_a_heel_that_was_held_too_long_does_not_snap_up_when_the_ball_takes_over() -> None:
    leg = make_leg(np.stack([0 * TIME, 0 * TIME, np.full(N, 0.87)], axis=1), np.full(N, 0.25))
    rise = 0.04 * np.clip((TIME - 0.8) / 0.4, 0, 1)[:, None] * [0.0, 0.0, 1.0]  # 27 mm of it before the heel lets go
    leg = replace(leg, ankle=leg.ankle + rise)
    contacts = np.ones((N, 2))
    contacts[32:, 0] = 0.0
    target, _ = ankle_targets(leg, contacts, SOLE, time_s=TIME)
    assert np.linalg.norm(np.diff(target, axis=0), axis=1).max() < 0.015


def test_a_foot_that_left_for_another_place_within_a_contact_stands_there() -> None:
    leg = make_leg(np.stack([0 * TIME, 0 * TIME, np.full(N, 0.87)], axis=1), np.full(N, 0.25))
    step = 0.09 * np.clip((TIME - 0.8) / 0.2, 0, 1)[:, None] * [1.0, 0.0, 0.0]  # while the contact goes on
    leg = replace(leg, hip=leg.hip + step, knee=leg.knee + step, ankle=leg.ankle + step, toe=leg.toe + step)
    contacts = np.ones((N, 2))
    contacts[29:31, 0] = 0.0
    target, _ = ankle_targets(leg, contacts, SOLE, time_s=TIME)
    assert np.abs(target[:20, 0] - leg.ankle[0, 0]).max() < 0.005
    assert np.abs(target[40:, 0] - leg.ankle[-1, 0]).max() < 0.01
    assert np.linalg.norm(np.diff(target, axis=0), axis=1).max() < 0.05


def test_a_contact_that_is_far_off_is_not_believed() -> None:
    leg = make_leg(np.stack([1.0 * TIME, 0 * TIME, np.full(N, 0.87)], axis=1), np.full(N, 0.25))
    after = locked(leg, np.ones((N, 2)))
    np.testing.assert_allclose(after.ankle, leg.ankle, atol=1e-9)


def test_bones_keep_their_lengths_and_knees_their_side() -> None:
    leg = sliding_leg()
    target = leg.ankle + np.array([0.05, 0.1, 0.1])
    after = posed(leg, target, leg.R_ankle)
    np.testing.assert_allclose(after.ankle, target, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(after.knee - after.hip, axis=1), 0.42, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(after.ankle - after.knee, axis=1), 0.40, atol=1e-9)
    middle = (after.hip + after.ankle) / 2
    assert ((after.knee - middle)[:, 1] > 0.05).all()  # in front, where it was
    np.testing.assert_allclose(after.R_ankle, leg.R_ankle, atol=1e-9)


def test_a_place_out_of_reach_stretches_the_leg_no_further_than_it_is_long() -> None:
    leg = sliding_leg()
    after = posed(leg, leg.ankle - np.array([0.0, 0.0, 0.3]), leg.R_ankle)
    reach = np.linalg.norm(after.ankle - after.hip, axis=1)
    assert reach.max() <= LockSettings().longest_reach * 0.82 + 1e-9


def test_a_straight_leg_moves_its_knee_steadily() -> None:
    """The axis of a straight knee is not seen: the joint's own is used, so that noise does not turn the leg about."""
    rng = np.random.default_rng(0)
    leg = make_leg(np.stack([0 * TIME, 0 * TIME, np.full(N, 0.89)], axis=1), np.full(N, 0.004))
    leg = replace(leg, knee=leg.knee + 0.0005 * rng.normal(size=(N, 3)))
    after = posed(leg, leg.ankle + np.array([0.0, 0.0, 0.03]), leg.R_ankle)
    assert np.linalg.norm(np.diff(after.knee, axis=0), axis=1).max() < 0.02


def test_a_leg_that_does_not_reach_its_anchor_has_no_sudden_stop() -> None:
    hip = np.stack([0 * TIME, 0.25 * TIME, np.full(N, 0.79)], axis=1)
    leg = make_leg(hip, np.full(N, 0.2))
    after = posed(leg, np.broadcast_to([0.0, 0.0, 0.0], (N, 3)), leg.R_ankle)
    bend = np.arcsin(np.linalg.norm(np.cross(after.knee - leg.hip, after.ankle - after.knee), axis=1) / (0.42 * 0.40))
    assert np.linalg.norm(after.ankle - leg.hip, axis=1).max() <= max(0.995, np.cos(0.2) + 0.002) * 0.82
    assert np.abs(np.diff(bend, 2)).max() < 0.01


@pytest.mark.parametrize("below_m", [0.0, 0.05])
def test_a_standing_foot_that_points_down_does_not_go_through_the_floor(below_m: float) -> None:
    rest, num_frames = load_body().rest_joints(np.zeros(10)), 30
    vectors = np.zeros((num_frames, 24, 3), np.float32)
    vectors[:, 0, 0] = np.pi / 2  # the rest pose's y is up
    vectors[:, [1, 2], 0], vectors[:, [4, 5], 0] = -0.4, 0.8
    vectors[:, [7, 8], 0] = 0.0  # thighs and shins cancel: this is how far a foot points down
    motion = LongMotion(Skeleton(rest, np.zeros(0, int), np.zeros((0, 3))), vectors, np.zeros((num_frames, 3)))
    ground = np.array([0.08, 0.03, 0.08, 0.03])
    up = ground[0] - below_m - contact_positions(motion)[0, 0, 2]
    motion = replace(motion, pelvis_ref=motion.pelvis_ref + np.array([0.0, 0.0, up]))
    assert (contact_positions(motion)[:, 1, 2] < ground[1] - 0.03).all()
    after = contact_positions(lock_feet(motion, np.ones((num_frames, 4)), ground, time_s=np.arange(num_frames) / 30))
    assert np.allclose(after[..., 2], ground, atol=0.005)


def test_legs_of_a_motion_are_those_of_the_whole_body() -> None:
    rng = np.random.default_rng(3)
    rest, num_frames = load_body().rest_joints(np.zeros(10)), 600  # more than are worked on at once
    vectors = rng.normal(size=(num_frames, 24, 3)).astype(np.float32)
    motion = LongMotion(Skeleton(rest, np.zeros(0, int), np.zeros((0, 3))), vectors, rng.normal(size=(num_frames, 3)))
    joints, R = compose(rest, rotvec_to_rotmat(vectors), motion.pelvis_ref)
    np.testing.assert_allclose(contact_positions(motion), joints[:, CONTACT_JOINTS], atol=1e-9)
    for side, (hip, knee, ankle, toe) in enumerate(LEGS):
        leg = Leg.of(motion, side, slice(100, 110))
        places = np.stack([leg.hip, leg.knee, leg.ankle, leg.toe], axis=1)
        np.testing.assert_allclose(places, joints[100:110, [hip, knee, ankle, toe]], atol=1e-9)
        rotations = np.stack([leg.R_pelvis, leg.R_hip, leg.R_knee, leg.R_ankle], axis=1)
        np.testing.assert_allclose(rotations, R[100:110, [0, hip, knee, ankle]], atol=1e-9)
