"""The body with fingers: made by its script, the same body as body24 while the fingers rest."""

import numpy as np
import two_people
from hand_points import with_hands

from humanmm.models.body.body24 import load_body
from humanmm.models.body.fingers import (
    FINGER_NAMES,
    JOINT_NAMES_52,
    NUM_BODY_JOINTS,
    PARENTS_52,
    body_of,
    from_flat_hands,
    load_body52,
)
from humanmm.models.body.kinematics import compose, forward_kinematics, skinning_transforms
from humanmm.models.geometry.rotations import rotvec_to_rotmat


def test_joints_stand_in_the_order_of_smpl_h() -> None:
    assert len(JOINT_NAMES_52) == len(PARENTS_52) == 52
    assert JOINT_NAMES_52[22:37:3] == ("L_Index1", "L_Middle1", "L_Pinky1", "L_Ring1", "L_Thumb1")
    assert JOINT_NAMES_52[37:] == tuple(name.replace("L_", "R_") for name in FINGER_NAMES[:15])
    assert PARENTS_52[22:26] == (20, 22, 23, 20)
    assert PARENTS_52[37:40] == (21, 37, 38)


def test_left_and_right_hand_are_mirror_images() -> None:
    left, right = np.split(load_body52().J_template[NUM_BODY_JOINTS:], 2)
    np.testing.assert_allclose(left * (-1, 1, 1), right, atol=1e-3)


def test_the_skin_of_any_pose_is_body24s_while_the_fingers_rest() -> None:
    rng = np.random.default_rng(1)
    pose, betas = rng.normal(0, 0.4, (2, 23, 3)), rng.normal(0, 1, 10)
    pose[:, 21:] = 0
    skins = []
    for body, vectors in (
        (load_body(), pose),
        (load_body52(), np.concatenate([pose[:, :21], np.zeros((2, 30, 3))], axis=1)),
    ):
        rest = body.rest_joints(betas)
        joints, R = forward_kinematics(rest, np.tile(np.eye(3), (2, 1, 1)), vectors, np.zeros((2, 3)), body.parents)
        T = np.einsum("vk,nvkab->nvab", body.skin_weight, skinning_transforms(rest, joints, R)[:, body.skin_joint])
        vertices = body.rest_vertices(betas)
        skins.append(np.einsum("nvab,vb->nva", T[..., :3], vertices) + T[..., 3])
    apart = np.linalg.norm(skins[0] - skins[1], axis=-1)
    assert apart.max() < 2e-3  # weights of half precision, and of five joints the four largest


def test_bending_a_finger_moves_its_own_skin_alone() -> None:
    body = load_body52()
    joint = JOINT_NAMES_52.index("L_Index2")
    R = np.tile(np.eye(3), (1, 52, 1, 1))
    R[0, joint] = rotvec_to_rotmat(np.array([0, 0, -1.0]))
    joints, R_world = compose(body.J_template, R, np.zeros((1, 3)), body.parents)
    T = np.einsum(
        "vk,vkab->vab", body.skin_weight, skinning_transforms(body.J_template, joints, R_world)[0][body.skin_joint]
    )
    vertices = body.v_template
    moved = np.linalg.norm(np.einsum("vab,vb->va", T[..., :3], vertices) + T[..., 3] - vertices, axis=1)
    assert moved.max() > 0.02
    about = np.linalg.norm(vertices - body.J_template[joint], axis=1)
    assert about[moved > 1e-3].max() < 0.07


def test_the_tips_of_flat_hands_point_where_ours_do() -> None:
    """A bone that lies flat at rest, posed by the converted rotations, has the direction of ours."""
    rng = np.random.default_rng(2)
    ours = rng.normal(0, 0.5, (4, 30, 3))
    R, R_flat = (rotvec_to_rotmat(vectors) for vectors in (ours, from_flat_hands(ours)))
    joints = load_body52().J_template[NUM_BODY_JOINTS:]
    bone = (joints[1] - joints[0]) * (1, 1, 0)
    np.testing.assert_allclose(R_flat[:, 0] @ [1, 0, 0], R[:, 0] @ bone / np.linalg.norm(bone), atol=1e-9)
    bone = (joints[2] - joints[1]) * (1, 1, 0)
    second, second_flat = R[:, 0] @ R[:, 1], R_flat[:, 0] @ R_flat[:, 1]
    np.testing.assert_allclose(second_flat @ [1, 0, 0], second @ bone / np.linalg.norm(bone), atol=1e-9)
    np.testing.assert_allclose(from_flat_hands(ours)[:, 12:15], ours[:, 12:15], atol=1e-9)  # the thumb's


def test_a_person_has_the_body_that_his_pose_moves() -> None:
    person = two_people.recording().people[0]
    other = with_hands(two_people.recording()).people[0]
    assert person.pose().shape[1] + 1 == len(body_of(person).parents) == 24
    assert other.pose(slice(2, 7)).shape == (5, 51, 3)
    assert len(body_of(other).parents) == 52
