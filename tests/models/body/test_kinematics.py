"""The body: rest pose, forward kinematics, skinning, landmarks."""

import numpy as np
from scipy.spatial.transform import Rotation

from humanmm.models.body.body24 import FREE_JOINTS, JOINT_NAMES, PARENTS, load_body
from humanmm.models.body.kinematics import forward_kinematics, local_rotations, seen_rotations, skinning_transforms
from humanmm.models.body.landmarks import load_landmarks
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.records.landmarks import SWAP

BETAS = np.random.default_rng(0).normal(size=10)


def random_pose(frames: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    R_root = Rotation.random(frames, random_state=rng).as_matrix()
    return R_root, rng.normal(size=(frames, 23, 3)) * 0.4, rng.normal(size=(frames, 3))


def test_the_rest_pose_is_upright_faces_plus_z_and_has_its_left_on_plus_x() -> None:
    body = load_body()
    joints = body.rest_joints(np.zeros(10))
    at = {name: joints[k] for k, name in enumerate(JOINT_NAMES)}
    assert at["Head"][1] > at["Pelvis"][1] > at["L_Ankle"][1]
    assert at["L_Wrist"][0] > 0.5 > 0 > at["R_Wrist"][0]
    assert at["L_Foot"][2] > at["L_Ankle"][2] + 0.1
    assert 1.6 < np.ptp(body.v_template[:, 1]) < 1.9


def test_seen_rotations_are_the_root_and_the_free_joints_in_any_batch() -> None:
    R_root, body_pose, _ = random_pose(6)
    expected = local_rotations(R_root, body_pose)[:, [0, *FREE_JOINTS]]
    np.testing.assert_array_equal(seen_rotations(R_root, body_pose), expected)
    batch = seen_rotations(R_root.reshape(2, 3, 3, 3), body_pose.reshape(2, 3, 23, 3))
    np.testing.assert_array_equal(batch, expected.reshape(2, 3, 20, 3, 3))


def test_bone_lengths_do_not_depend_on_the_pose() -> None:
    rest = load_body().rest_joints(BETAS)
    joints, _ = forward_kinematics(rest, *random_pose(5))
    child, parent = np.arange(1, 24), np.array(PARENTS[1:])
    lengths = np.linalg.norm(joints[:, child] - joints[:, parent], axis=-1)
    expected = np.linalg.norm(rest[child] - rest[parent], axis=-1)
    np.testing.assert_allclose(lengths, np.broadcast_to(expected, lengths.shape), atol=1e-12)


def test_rotating_the_root_rotates_everything_about_the_pelvis() -> None:
    rest = load_body().rest_joints(BETAS)
    R_root, body_pose, pelvis = random_pose(4)
    turn = rotvec_to_rotmat([0.3, -1.2, 0.5])
    joints, R = forward_kinematics(rest, R_root, body_pose, pelvis)
    turned, R_turned = forward_kinematics(rest, turn @ R_root, body_pose, pelvis)
    np.testing.assert_allclose(turned - pelvis[:, None], (joints - pelvis[:, None]) @ turn.T, atol=1e-12)
    np.testing.assert_allclose(R_turned, turn @ R, atol=1e-12)


def test_the_rest_pose_leaves_every_rest_point_where_it_is() -> None:
    rest = load_body().rest_joints(BETAS)
    joints, R = forward_kinematics(rest, np.eye(3)[None], np.zeros((1, 23, 3)), rest[:1])
    transforms = skinning_transforms(rest, joints, R)
    np.testing.assert_allclose(transforms[0], np.tile(np.eye(3, 4), (24, 1, 1)), atol=1e-12)


def test_landmarks_are_left_right_symmetric_within_the_mesh_s_own_asymmetry() -> None:
    body, landmarks = load_body(), load_landmarks()
    joints = body.rest_joints(np.zeros(10))[None]
    places = landmarks.place(np.zeros(10), joints, np.broadcast_to(np.eye(3), (1, 24, 3, 3)))[0]
    np.testing.assert_allclose(places[SWAP] * [-1, 1, 1], places, atol=2e-3)
    assert list(SWAP[SWAP]) == list(range(33))


def test_skin_landmarks_lie_near_the_skin_where_the_detector_puts_them() -> None:
    body, landmarks = load_body(), load_landmarks()
    joints = body.rest_joints(BETAS)[None]
    places = landmarks.place(BETAS, joints, np.broadcast_to(np.eye(3), (1, 24, 3, 3)))[0]
    vertices = body.rest_vertices(BETAS)
    for k in (0, 2, 5, 7, 8, 9, 10, 29, 30, 31, 32):
        assert np.linalg.norm(vertices - places[k], axis=1).min() < 0.03
