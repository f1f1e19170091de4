"""The truth that detections are measured against."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.body.landmarks import load_landmarks
from humanmm.models.records.sequence import BodyParameters, CameraSequence, PersonSequence
from humanmm.models.synthetic.detector_noise import LIMBS
from humanmm.models.synthetic.noise_series import limb_mask, true_landmarks

N = 4
R_UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Upright, facing the world's −y."""


def person_and_camera(side: float) -> tuple[PersonSequence, CameraSequence]:
    """Somebody at the origin, and a camera 4 m before (side −1) or behind (side +1) them that looks at them."""
    rest, R = load_body().rest_joints(np.zeros(10)), np.tile(R_UPRIGHT, (N, 1, 1))
    joints, _ = forward_kinematics(rest, R, np.zeros((N, 23, 3)), np.zeros((N, 3)))
    rotvec = np.tile([np.pi / 2, 0.0, 0.0], (N, 1))
    body = BodyParameters("body24", rotvec, np.zeros((N, 23, 3)), np.zeros(10), np.zeros((N, 3)))
    R_world_cam = np.array([[-side, 0.0, 0.0], [0.0, 0.0, -side], [0.0, -1.0, 0.0]])
    cameras = CameraSequence(
        np.tile(R_world_cam, (N, 1, 1)), np.tile([0.0, 4.0 * side, 0.0], (N, 1)), np.tile(np.eye(3), (N, 1, 1))
    )
    return PersonSequence(0, np.arange(N), np.ones(N, bool), joints, body=body), cameras


@pytest.mark.parametrize(("side", "behind"), [(-1.0, False), (1.0, True)])
def test_landmarks_stand_before_the_camera_and_the_back_is_known(side: float, behind: bool) -> None:
    person, cameras = person_and_camera(side)
    points, seen_behind, stature = true_landmarks(person, cameras, np.arange(N))
    assert seen_behind.tolist() == [behind] * N
    np.testing.assert_allclose(points[:, 23:25].mean(axis=1)[:, 2], 4.0, atol=0.1)
    assert stature == pytest.approx(1.0)
    # The left hip is to the right in the picture of somebody who faces the camera.
    assert (points[0, 23, 0] > points[0, 24, 0]) == (not behind)
    nose, heel = points[0, 0], points[0, 29]
    assert nose[1] < heel[1]  # y is down


def test_landmarks_are_those_of_the_posed_body() -> None:
    person, cameras = person_and_camera(-1.0)
    points, _, _ = true_landmarks(person, cameras, np.array([2]))
    R = np.tile(R_UPRIGHT, (1, 24, 1, 1))
    placed = load_landmarks().place(np.zeros(10), person.joints[2:3], R)
    np.testing.assert_allclose(np.linalg.norm(points[0] - points[0, 0], axis=-1),
                               np.linalg.norm(placed[0] - placed[0, 0], axis=-1), atol=1e-9)  # fmt: skip


def test_a_truth_without_a_body_is_refused() -> None:
    person, cameras = person_and_camera(-1.0)
    with pytest.raises(ValueError, match="no body model"):
        true_landmarks(replace(person, body=None), cameras, np.arange(N))


def test_a_limb_is_all_of_its_landmarks() -> None:
    mask = limb_mask(np.array([[True, False], [False, False], [False, True], [False, False]]))
    assert np.flatnonzero(mask[0]).tolist() == sorted(LIMBS[0])
    assert np.flatnonzero(mask[1]).tolist() == sorted(LIMBS[2])
