"""Arms of one take on the body of another: whose is what, and nobody's arm goes through somebody's body."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.body.body24 import JOINT_NAMES, load_body
from humanmm.models.geometry.axes import R_ZUP_YUP
from humanmm.models.rendering.places.recombination import ARM_JOINTS, clearance_m, with_arms_of
from humanmm.models.synthetic.mocap import MocapSequence

FRAMES, FPS = 90, 30.0
THROUGH = (0.0, 0.0, -2.1)
"""Of the left shoulder: the arm hangs down through the trunk."""
ARMS = [joint - 1 for joint in ARM_JOINTS]
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
