"""Limbs of one take on the body of another: whose is what, and nobody's arm goes through somebody's body."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.body.body24 import JOINT_NAMES, load_body
from humanmm.models.geometry.axes import R_ZUP_YUP
from humanmm.models.geometry.rotations import angle_between_deg, rotvec_to_rotmat
from humanmm.models.rendering.places.recombination import (
    LEFT_ARM,
    LIMBS,
    RIGHT_ARM,
    TOUCHING_M,
    clearance_m,
    loosened,
    with_arms_of,
)
from humanmm.models.synthetic.mocap import MocapSequence

FRAMES, FPS = 90, 30.0
THROUGH = (0.0, 0.0, -2.1)
"""Of the left shoulder: the arm hangs down through the trunk."""
ARMS = [joint - 1 for joint in LEFT_ARM + RIGHT_ARM]
REST = [joint for joint in range(23) if joint not in ARMS]


def standing(name: str, *, left_shoulder: tuple[float, float, float] = (0, 0, 0), still: bool = False) -> MocapSequence:
    """Somebody with arms held out from the sides who moves all joints a little; the left arm is held otherwise."""
    rng = np.random.default_rng(len(name))
    pose = (
        np.zeros((FRAMES, 23, 3))
        if still
        else 0.05 * np.sin(np.arange(FRAMES)[:, None, None] / 9 + rng.random((23, 3)))
    )
    pose[:, JOINT_NAMES.index("L_Shoulder") - 1] = left_shoulder
    return MocapSequence(
        name, FPS, np.tile(R_ZUP_YUP, (FRAMES, 1, 1)), pose, np.linspace([0, 0, 0.9], [1, 0, 0.9], FRAMES),
        np.ones((FRAMES, 4)), leg_m=0.8,
    )  # fmt: skip


def test_arms_are_the_others_and_everything_else_is_its_own() -> None:
    take, other = standing("a"), replace(standing("other"), fps=15.0)
    before = take.body_pose.copy()
    made = with_arms_of(take, other, np.random.default_rng(0))
    assert made is not None and made.fps == FPS and made.num_frames == FRAMES
    np.testing.assert_array_equal(made.body_pose[:, REST], take.body_pose[:, REST])
    np.testing.assert_array_equal(made.pelvis, take.pelvis)
    rate = [np.abs(np.diff(one.body_pose[:, ARMS], axis=0)).mean() for one in (made, other)]
    assert rate[0] == pytest.approx(rate[1] / 2, rel=0.2)  # twice as many frames of the same time
    np.testing.assert_array_equal(take.body_pose, before)


def test_an_arm_through_the_trunk_is_no_motion() -> None:
    through = standing("through", left_shoulder=THROUGH, still=True)
    assert clearance_m(standing("t", still=True), load_body()).min() > 0.05
    assert clearance_m(through, load_body()).max() < 0
    assert with_arms_of(standing("a"), through, np.random.default_rng(0)) is None


def test_the_longest_part_without_a_collision_is_kept() -> None:
    take, other = standing("a", still=True), standing("t", still=True)
    other.body_pose[:30, JOINT_NAMES.index("L_Shoulder") - 1] = THROUGH
    made = with_arms_of(take, other, np.random.default_rng(0))
    assert made is not None and 55 <= made.num_frames <= 60
    assert clearance_m(made, load_body()).min() > 0


def test_a_loosened_take_moves_like_several_people_and_like_none_of_them() -> None:
    take, other = standing("a", still=True), standing("other")
    other.body_pose[:, [joint - 1 for limb in LIMBS[2:] for joint in limb]] += 0.4
    before = take.body_pose.copy()
    rng = np.random.default_rng(1)
    made = [one for one in (loosened(take, [other], rng) for _ in range(40)) if one is not None]
    assert len(made) > 30 and all(0.7 * FPS <= one.num_frames <= FRAMES for one in made)
    assert all(clearance_m(one, load_body()).min() > TOUCHING_M for one in made)
    hip, knee = (JOINT_NAMES.index(name) - 1 for name in ("L_Hip", "L_Knee"))
    replaced = np.array([np.linalg.norm(one.body_pose[:, knee], axis=-1).mean() > 0.3 for one in made])
    assert 0.25 < replaced.mean() < 0.75
    own = [
        rotvec_to_rotmat(one.body_pose[:, hip]) for one, is_others in zip(made, replaced, strict=True) if not is_others
    ]
    off_deg = np.array([angle_between_deg(R[0], np.eye(3)) for R in own])
    turned_deg = np.array([angle_between_deg(R[0], R[-1]) for R in own])
    assert 5 < off_deg.mean() < 25 and 2 < turned_deg.mean() < 25
    np.testing.assert_array_equal(take.body_pose, before)
