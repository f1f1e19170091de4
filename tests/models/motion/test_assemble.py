"""The recording: where world motion, observations and shots meet."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.motion.assemble import assemble, continuous_rotvec, record_motion, world_joints
from humanmm.models.records.hands import not_looked
from humanmm.models.records.landmarks import INDEX
from humanmm.models.records.motion import CutAlignment, PersonMotion, WorldMotion
from humanmm.models.records.recording import Recording
from humanmm.models.records.shots import Appearance, Person, Shot, ShotList, Transition
from humanmm.models.records.tracks import PersonTrack, ScenePeople, Silhouettes
from humanmm.models.records.video import VideoFacts

F = 20
LEFT_KNEE, RIGHT_KNEE = INDEX["left_knee"], INDEX["right_knee"]


def test_continuous_rotation_vectors_are_the_same_rotations() -> None:
    R = Rotation.random(50, random_state=0).as_matrix()
    np.testing.assert_allclose(Rotation.from_rotvec(continuous_rotvec(R)).as_matrix(), R, atol=1e-12)


def test_somebody_who_turns_ten_times_has_no_jump_in_the_rotation_vector() -> None:
    upright = Rotation.from_euler("x", 90, degrees=True)
    R = (Rotation.from_euler("z", np.linspace(0, 20 * np.pi, 2000)[:, None]) * upright).as_matrix()
    steps = np.linalg.norm(np.diff(continuous_rotvec(R), axis=0), axis=1)
    assert steps.max() < 0.11  # 1.8° a frame are 0.031 rad, stretched by θ/2 / sin(θ/2) = 3.3 at 270°


def test_no_rotation_is_the_zero_vector() -> None:
    np.testing.assert_array_equal(continuous_rotvec(np.tile(np.eye(3), (3, 1, 1))), np.zeros((3, 3)))


def seen_twice() -> tuple[VideoFacts, ShotList, list[ScenePeople | None], WorldMotion]:
    """One person, seen in frames 0-4 and 12-19, before and after a dissolve over [8, 12); labels swapped after it."""
    rng = np.random.default_rng(3)
    betas = rng.normal(size=10) * 0.3
    R = Rotation.from_euler("zx", [[0.1 * i, 1.5] for i in range(F)]).as_matrix()
    pose = rng.normal(size=(F, 23, 3)) * 0.2
    pelvis = np.stack([np.linspace(0, 1, F), np.zeros(F), np.ones(F)], axis=1)
    motion = WorldMotion(
        R_world_cam=np.tile(np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]), (F, 1, 1)),
        t_world_cam=np.tile([0.0, -4.0, 1.0], (F, 1)),
        K=np.tile([[500.0, 0, 320], [0, 500, 180], [0, 0, 1]], (F, 1, 1)),
        camera_source=np.zeros(F, np.uint8),
        people=(
            PersonMotion(
                person=0, frame=np.arange(F, dtype=np.int32), observed=np.ones(F, bool), R_world_root=R, body_pose=pose,
                betas=betas, pelvis_world=pelvis, contacts=np.zeros((F, 4), np.float32),
                confidence=np.ones(F, np.float32),
            ),
        ),
        cuts=(),
    )  # fmt: skip
    tracks = [_track(np.arange(0, 5, dtype=np.int32)), _track(np.arange(12, 20, dtype=np.int32))]
    shots = ShotList(
        num_frames=F,
        shots=(
            Shot(0, 0, 10, 0, None, (Appearance(0, 0, ()),)),
            Shot(1, 10, F, 1, Transition("dissolve", 8, 12, "scene"), (Appearance(0, 0, ((12, 15),)),)),
        ),
        people=(Person(0, betas.astype(np.float32), 1.0),),
    )
    scenes: list[ScenePeople | None] = [ScenePeople(0, 10, (tracks[0],)), ScenePeople(10, F, (tracks[1],))]
    facts = VideoFacts(640, 360, np.arange(F) / 25, np.ones(F, bool), 0, "h264", "mp4")
    return facts, shots, scenes, motion


@pytest.fixture(scope="module")
def assembled() -> Recording:
    facts, shots, scenes, motion = seen_twice()
    at_rest = load_body().rest_joints(motion.people[0].betas)
    rest, joints = {0: at_rest[0]}, {0: world_joints(motion.people[0], at_rest, window=7)}
    return assemble(facts, shots, scenes, motion, rest_pelvis=rest, joints_world=joints)


def _track(frame: np.ndarray) -> PersonTrack:
    keypoints2d = np.zeros((len(frame), 33, 3), np.float32)
    keypoints2d[:, LEFT_KNEE] = (1, 1, 0.9)
    keypoints2d[:, RIGHT_KNEE] = (2, 2, 0.8)
    n = len(frame)
    return PersonTrack(
        frame, keypoints2d, np.zeros((n, 33, 3), np.float32), np.tile(np.float32([10, 20, 30, 40]), (n, 1)),
        np.ones(n, np.float32), Silhouettes.pack(np.zeros((n, 128, 128))), np.zeros((n, 2, 3), np.float32), frame[:1],
        np.ones((1, 8), np.float32) / 8,
    )  # fmt: skip


def test_forward_kinematics_of_the_recorded_parameters_gives_the_recorded_joints(assembled: Recording) -> None:
    person = assembled.people[0]
    rest = load_body().rest_joints(person.betas)
    R = Rotation.from_rotvec(person.root_orient).as_matrix()
    joints, _ = forward_kinematics(rest, R, person.body_pose, person.transl + rest[0])
    np.testing.assert_allclose(joints, person.joints, atol=1e-5)


def test_frames_inside_a_dissolve_are_not_observed(assembled: Recording) -> None:
    assert np.flatnonzero(~assembled.people[0].observed).tolist() == [8, 9, 10, 11]
    assert assembled.cut_frames == (10,)
    assert np.flatnonzero(np.diff(assembled.shot_index)).tolist() == [9]


def test_left_and_right_are_exchanged_where_the_detector_had_them_swapped(assembled: Recording) -> None:
    keypoints2d = assembled.people[0].keypoints2d
    np.testing.assert_array_equal(keypoints2d[[0, 4, 15, 19], LEFT_KNEE, 0], 1)
    np.testing.assert_array_equal(keypoints2d[12:15, LEFT_KNEE, 0], 2)
    np.testing.assert_array_equal(keypoints2d[12:15, RIGHT_KNEE, 0], 1)


def test_where_nothing_was_detected_confidence_is_zero_and_the_box_is_that_of_the_body(assembled: Recording) -> None:
    person = assembled.people[0]
    assert not person.keypoints2d[5:12, :, 2].any()
    np.testing.assert_array_equal(person.bbox[0], [10, 20, 30, 40])
    x0, y0, x1, y1 = person.bbox[7]
    assert 320 - 120 < x0 < 320 < x1 < 320 + 320  # the pelvis is a third of a metre right of the axis, 4 m away
    assert y0 < 180 < y1


def test_a_recording_with_a_hole_in_a_persons_frames_is_refused(assembled: Recording) -> None:
    person = assembled.people[0]
    fields = {**vars(person), "frame": np.r_[0:10, 11:21].astype(np.int32)}
    with pytest.raises(ValueError, match="holes"):
        type(person)(**fields)


def test_hands_that_were_looked_at_in_one_shot_are_in_the_whole_recording() -> None:
    facts, shots, scenes, motion = seen_twice()
    assert record_motion(facts, shots, scenes, motion).people[0].hand_pose is None
    first = scenes[0]
    assert first is not None
    track = replace(first.tracks[0], hands=not_looked(len(first.tracks[0].frame)))
    (person,) = record_motion(facts, shots, [replace(first, tracks=(track,)), scenes[1]], motion).people
    assert person.hand_pose is not None and person.hand_pose.shape == (F, 30, 3)
    assert person.hand_confidence is not None and not person.hand_confidence.any()
    np.testing.assert_allclose(person.body_pose, motion.people[0].body_pose, atol=1e-6)


def test_a_shot_that_nothing_joins_is_a_world_of_its_own() -> None:
    facts, shots, scenes, motion = seen_twice()
    assert record_motion(facts, shots, scenes, motion).worlds == ()
    apart = CutAlignment(shots.shots[1].start, "none", np.eye(3), np.nan, 180.0, np.nan, linked=False)
    assert record_motion(facts, shots, scenes, replace(motion, cuts=(apart,))).worlds == (0, 1)
