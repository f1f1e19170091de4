"""How fingers bend."""

import numpy as np
import pytest
from hand_points import landmarks_of, random_angles

from humanmm.models.body.fingers import load_body52
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.motion.hands.finger_joints import (
    AT_EASE,
    BEND1,
    HIGHEST,
    LOWEST,
    finger_directions,
    fingertips,
    hand_at_rest,
    hand_pose,
)


@pytest.mark.parametrize("side", [0, 1])
def test_bending_leads_to_the_palm(side: int) -> None:
    """At rest both palms look down."""
    flat, bent = np.zeros((1, 5, 5)), np.zeros((1, 5, 5))
    bent[..., BEND1] = 0.5
    down = finger_directions(side, bent)[0, :, 0, 1] - finger_directions(side, flat)[0, :, 0, 1]
    assert (down < -0.1).all()


def test_left_and_right_bend_as_mirror_images() -> None:
    angles = random_angles(20)
    left, right = (finger_directions(side, angles * (1, 1, 1, 1, 1)) for side in (0, 1))
    np.testing.assert_allclose(left[..., 0, 1].mean(), right[..., 0, 1].mean(), atol=0.05)
    ease = np.tile(AT_EASE, (1, 1, 1))
    np.testing.assert_allclose(
        finger_directions(0, ease) * (-1, 1, 1), finger_directions(1, ease), atol=0.02
    )  # the mesh is symmetric to a millimetre


def test_a_hand_at_ease_is_within_the_ranges_of_motion() -> None:
    assert ((LOWEST < AT_EASE) | (LOWEST == AT_EASE)).all() and (AT_EASE < HIGHEST).all()


def test_axes_are_perpendicular_to_the_bone_at_the_base() -> None:
    for side in (0, 1):
        rest = hand_at_rest(side)
        for axes in (rest.bend, rest.spread):
            np.testing.assert_allclose(np.einsum("fa,fa->f", axes, rest.bones[:, 0]), 0, atol=1e-9)


def test_tips_lie_one_bone_beyond_the_last_joint() -> None:
    body = load_body52()
    length = np.linalg.norm(fingertips(body, 0) - body.J_template[22:37].reshape(5, 3, 3)[:, 2], axis=1)
    assert ((length > 0.01) & (length < 0.04)).all()


def test_the_pose_moves_the_bodys_joints_where_the_directions_say() -> None:
    body, angles = load_body52(), np.stack([random_angles(3), random_angles(3, seed=1)], axis=1)
    pose = np.concatenate([np.zeros((3, 21, 3)), hand_pose(angles)], axis=1)
    joints, _ = forward_kinematics(body.J_template, np.tile(np.eye(3), (3, 1, 1)), pose, np.zeros((3, 3)), body.parents)
    for side, first in ((0, 22), (1, 37)):
        points = landmarks_of(side, angles[:, side])
        index = joints[:, first : first + 3] - joints[:, 20 + side, None]
        np.testing.assert_allclose(index, points[:, 5:8] - points[:, :1], atol=1e-9)
