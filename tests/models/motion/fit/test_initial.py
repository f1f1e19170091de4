"""Where a fit starts: inverse kinematics that nearly inverts forward kinematics, and positions on viewing rays."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from humanmm.models.motion.fit.evidence import person_skeleton
from humanmm.models.motion.fit.initial import interpolated, start_pose
from humanmm.models.motion.fit.state import LongMotion, Motion

N = 12


def motion(bend: float, rng: np.random.Generator) -> Motion:
    """Random roots; shoulders, hips, elbows and knees bent by some random angles of size `bend`, radians."""
    R = np.tile(np.eye(3), (N, 24, 1, 1))
    R[:, 0] = Rotation.random(N, random_state=1).as_matrix()
    for joint in (1, 2, 16, 17):
        R[:, joint] = Rotation.from_rotvec(bend * rng.uniform(-1, 1, (N, 3))).as_matrix()
    for joint in (4, 5):
        R[:, joint] = Rotation.from_rotvec(bend * rng.uniform(0, 1, (N, 1)) * [1.0, 0, 0]).as_matrix()
    for joint, side in ((18, -1.0), (19, 1.0)):
        R[:, joint] = Rotation.from_rotvec(bend * rng.uniform(0, 1, (N, 1)) * [0, side, 0]).as_matrix()
    return Motion.of(person_skeleton(np.zeros(10)), R, np.zeros((N, 3)))


@pytest.mark.parametrize("bend", [0.0, 0.8])
def test_landmarks_of_a_body_give_a_pose_whose_landmarks_they_nearly_are(bend: float, rng: np.random.Generator) -> None:
    truth = motion(bend, rng)
    found = Motion.of(
        person_skeleton(np.zeros(10)), start_pose(person_skeleton(np.zeros(10)), truth.points + 3.0), np.zeros((N, 3))
    )
    error = np.linalg.norm(found.points - truth.points, axis=-1)
    assert np.median(error) < 0.02
    assert error.max() < 0.15  # a straight limb's twist is open, and with it where its end's landmarks ride


def test_unknown_frames_lie_on_the_way_between_known_ones_in_time() -> None:
    time_s = np.array([0.0, 0.1, 0.4, 0.5])
    vectors = np.zeros((4, 24, 3), np.float32)
    vectors[3, 5] = [0.0, 1.0, 0.0]
    pelvis = np.array([[0.0, 0, 0], [9, 9, 9], [9, 9, 9], [5.0, 0, 0]])
    found = interpolated(
        LongMotion(person_skeleton(np.zeros(10)), vectors, pelvis), np.array([True, False, False, True]), time_s
    )
    np.testing.assert_allclose(found.pelvis_ref[:, 0], [0.0, 1.0, 4.0, 5.0])
    np.testing.assert_allclose(found.vectors[:, 5, 1], [0.0, 0.2, 0.8, 1.0], atol=1e-6)


def test_a_motion_that_is_known_throughout_stays_as_it_is() -> None:
    whole = LongMotion(person_skeleton(np.zeros(10)), np.zeros((4, 24, 3), np.float32), np.zeros((4, 3)))
    assert interpolated(whole, np.ones(4, bool), np.arange(4.0)) is whole
