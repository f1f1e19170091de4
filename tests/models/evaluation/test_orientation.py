"""Root orientation errors, and orientations from joints."""

import numpy as np
import pytest

from humanmm.models.body.body24 import JOINT_NAMES, load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.evaluation import orientation
from humanmm.models.geometry.alignment import yaw_to_rotmat
from humanmm.models.geometry.rotations import rotation_angle, rotvec_to_rotmat
from humanmm.models.records.sequence import MotionSequence


@pytest.fixture
def R(sequence: MotionSequence) -> np.ndarray:
    of_root = sequence.people[0].R_world_root
    assert of_root is not None
    return of_root


def test_another_world_costs_nothing(R: np.ndarray) -> None:
    turned = rotvec_to_rotmat([0.3, -0.2, 1.9]) @ R
    assert orientation.root_orientation_error_deg(turned, R) == pytest.approx(0.0, abs=1e-9)
    assert orientation.heading_error_deg(yaw_to_rotmat(2.0) @ R, R) == pytest.approx(0.0, abs=1e-9)


def test_a_wrong_rotation_at_a_cut_is_paid_in_every_later_frame(R: np.ndarray) -> None:
    wrong = R.copy()
    wrong[65:] = yaw_to_rotmat(np.radians(40)) @ wrong[65:]
    assert orientation.root_orientation_error_deg(wrong, R) == pytest.approx(20.0)
    assert orientation.heading_error_deg(wrong, R) == pytest.approx(20.0)


def test_a_rotation_of_nearly_two_right_angles_does_not_wrap(R: np.ndarray) -> None:
    wrong = R.copy()
    wrong[1:] = yaw_to_rotmat(np.radians(179)) @ wrong[1:]
    expected = 179.0 * (len(R) - 1) / len(R)
    assert orientation.heading_error_deg(wrong, R) == pytest.approx(expected)


def test_leaning_is_no_error_of_the_heading(R: np.ndarray) -> None:
    leaning = R @ rotvec_to_rotmat(np.linspace(0, 1, len(R))[:, None] * [1.2, 0.0, 0.0])
    assert orientation.heading_error_deg(leaning, R) == pytest.approx(0.0, abs=1e-9)
    assert orientation.root_orientation_error_deg(leaning, R) > 20


def test_the_upright_body_faces_minus_y_with_heading_zero() -> None:
    np.testing.assert_allclose(orientation.R_WORLD_UPRIGHT @ [0.0, 1.0, 0.0], [0.0, 0.0, 1.0])  # its up is the world's
    np.testing.assert_allclose(orientation.heading(orientation.R_WORLD_UPRIGHT[None]), 0.0)


def test_orientation_from_joints_is_that_of_the_root_in_a_straight_body(
    sequence: MotionSequence, R: np.ndarray
) -> None:
    still, nowhere = np.zeros((len(R), 23, 3)), np.zeros((len(R), 3))
    joints, _ = forward_kinematics(load_body().rest_joints(np.zeros(10)), R, still, nowhere)
    found = orientation.orientation_from_joints(joints, JOINT_NAMES)
    # the rest pose's shoulders stand a little in front of or behind its hips
    assert np.degrees(rotation_angle(np.swapaxes(found, 1, 2) @ R)).max() < 6.0
    np.testing.assert_allclose(np.linalg.det(found), 1.0)
