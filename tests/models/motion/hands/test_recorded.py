"""From looks at hands to the fingers of a recorded person, and wrists that lie as the palm was seen."""

from dataclasses import replace

import numpy as np
from hand_points import landmarks_of, random_angles

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.geometry.rotations import rotation_angle, rotvec_to_rotmat
from humanmm.models.motion.hands.finger_joints import AT_EASE, hand_pose
from humanmm.models.motion.hands.lifting import finger_angles
from humanmm.models.motion.hands.recorded import recorded_hands
from humanmm.models.records.hands import HandTracks
from humanmm.models.records.motion import PersonMotion, WorldMotion
from humanmm.models.records.shots import Appearance, Shot, Transition
from humanmm.models.records.tracks import PersonTrack, Silhouettes

F = 30
TIME_S = np.arange(F) / 15
K = np.array([[500.0, 0, 320], [0, 500, 180], [0, 0, 1]])
R_WORLD_CAM = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
BENT = rotvec_to_rotmat(np.array([0.2, 0.5, -0.3]))
"""How the left wrist is really bent, beyond the body's pose."""
ANGLES = random_angles(1)[0]


def scene() -> tuple[PersonMotion, WorldMotion, PersonTrack, np.ndarray]:
    """A body in some pose, whose left hand is seen in the first half; and the true rotation of its wrist."""
    rng = np.random.default_rng(0)
    pose = np.tile(rng.normal(0, 0.3, (23, 3)), (F, 1, 1))
    person = PersonMotion(
        person=0, frame=np.arange(F, dtype=np.int32), observed=np.ones(F, bool),
        R_world_root=np.tile(rotvec_to_rotmat(np.array([1.4, 0, 0.3])), (F, 1, 1)), body_pose=pose.astype(np.float32),
        betas=np.zeros(10), pelvis_world=np.tile([0, 0, 1.0], (F, 1)), contacts=np.zeros((F, 4), np.float32),
        confidence=np.ones(F, np.float32),
    )  # fmt: skip
    motion = WorldMotion(
        R_world_cam=np.tile(R_WORLD_CAM, (F, 1, 1)), t_world_cam=np.tile([0.0, -4.0, 1.0], (F, 1)),
        K=np.tile(K, (F, 1, 1)), camera_source=np.zeros(F, np.uint8), people=(person,), cuts=(),
    )  # fmt: skip
    rest = load_body().rest_joints(person.betas)
    _, R = forward_kinematics(rest, person.R_world_root, person.body_pose, person.pelvis_world)
    R_world_palm = R[0, 20] @ BENT
    hands = HandTracks(
        np.tile(np.float32([0.9, 0.0]), (F, 1)),
        np.zeros((F, 2, 21, 2), np.float32),
        np.zeros((F, 2, 21, 3), np.float32),
    )
    hands.confidence[F // 2 :, 0] = 0
    hands.points[:, 0] = K[:2, 2]  # at the middle of the picture, where the viewing ray is the camera's axis
    hands.points3d[:, 0] = landmarks_of(0, ANGLES[None])[0] @ (R_WORLD_CAM.T @ R_world_palm).T
    track = PersonTrack(
        person.frame, np.zeros((F, 33, 3), np.float32), np.zeros((F, 33, 3), np.float32), np.zeros((F, 4), np.float32),
        np.ones(F, np.float32), Silhouettes.pack(np.zeros((F, 128, 128))), np.zeros((F, 2, 3), np.float32),
        person.frame[:1], np.ones((1, 8), np.float32) / 8, hands=hands,
    )  # fmt: skip
    return person, motion, track, R_world_palm


SHOT = Shot(0, 0, F, 0, None, (Appearance(0, 0),))


def test_a_seen_hand_has_its_fingers_and_its_palm() -> None:
    person, motion, track, R_world_palm = scene()
    found = recorded_hands(person, motion, TIME_S, [(SHOT, track)])
    lifted = finger_angles(landmarks_of(0, ANGLES[None]), 0)
    expected = hand_pose(np.stack([lifted, AT_EASE[None]], axis=1))[0]
    np.testing.assert_allclose(found.hand_pose[5], expected, atol=1e-3)
    np.testing.assert_allclose(found.confidence[5], [0.9, 0], atol=1e-6)
    rest = load_body().rest_joints(person.betas)
    _, R = forward_kinematics(rest, person.R_world_root, found.body_pose, person.pelvis_world)
    assert np.rad2deg(rotation_angle(R[5, 20].T @ R_world_palm)) < 0.1


def test_a_hand_that_is_not_seen_is_at_ease_and_its_wrist_is_the_bodys() -> None:
    person, motion, track, _ = scene()
    found = recorded_hands(person, motion, TIME_S, [(SHOT, track)])
    ease = hand_pose(np.tile(AT_EASE, (1, 2, 1, 1)))[0]
    np.testing.assert_allclose(found.hand_pose[-1], ease, atol=1e-9)
    assert not found.confidence[-5:].any() and not found.confidence[:, 1].any()
    np.testing.assert_allclose(found.body_pose[-1], person.body_pose[-1], atol=1e-6)
    unchanged = [j for j in range(23) if j != 19]
    np.testing.assert_array_equal(found.body_pose[:, unchanged], person.body_pose[:, unchanged])


def test_inside_a_gradual_transition_nothing_is_seen() -> None:
    person, motion, track, _ = scene()
    dissolve = replace(SHOT, ending=Transition("dissolve", 0, F, "scene"))
    found = recorded_hands(person, motion, TIME_S, [(dissolve, track)])
    assert not found.confidence.any()


def test_a_palm_far_from_where_the_body_has_it_does_not_break_the_wrist() -> None:
    person, motion, track, _ = scene()
    assert track.hands is not None
    track.hands.points3d[:, 0] *= (-1, -1, 1)  # half a turn about the viewing ray
    found = recorded_hands(person, motion, TIME_S, [(SHOT, track)])
    np.testing.assert_allclose(found.body_pose, person.body_pose, atol=1e-6)


def test_one_palm_that_is_not_believed_leaves_the_wrist_as_the_looks_about_it_have_it() -> None:
    person, motion, track, R_world_palm = scene()
    assert track.hands is not None
    track.hands.points3d[6, 0] *= (-1, -1, 1)
    found = recorded_hands(person, motion, TIME_S, [(SHOT, track)])
    rest = load_body().rest_joints(person.betas)
    _, R = forward_kinematics(rest, person.R_world_root, found.body_pose, person.pelvis_world)
    assert np.rad2deg(rotation_angle(np.swapaxes(R[4:9, 20], -1, -2) @ R_world_palm)).max() < 0.1
    np.testing.assert_allclose(found.confidence[6], [0.9, 0], atol=1e-6)


def test_the_hands_of_who_was_not_looked_at_are_at_ease() -> None:
    person, motion, track, _ = scene()
    for sightings in ([(SHOT, replace(track, hands=None))], []):
        found = recorded_hands(person, motion, TIME_S, sightings)
        assert not found.confidence.any()
        np.testing.assert_allclose(found.hand_pose[3], hand_pose(np.tile(AT_EASE, (1, 2, 1, 1)))[0], atol=1e-9)
        np.testing.assert_allclose(found.body_pose, person.body_pose, atol=1e-6)
