"""Per-vertex error: nothing where nothing differs, and the skin's own distance where one joint does."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.body.body24 import load_body
from humanmm.models.evaluation.vertices import pve_mm
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.records.sequence import BodyParameters, MotionSequence, UndefinedFigureError

N = 3
ROWS = np.arange(N)
STILL = np.tile(np.eye(3), (N, 1, 1))
REST = BodyParameters("body24", np.zeros((N, 3)), np.zeros((N, 23, 3)), np.zeros(10), np.zeros((N, 3)))


def error_mm(predicted: BodyParameters | None, truth: BodyParameters | None, R_predicted: np.ndarray = STILL) -> float:
    return pve_mm(
        predicted, truth, predicted_rows=ROWS, truth_rows=ROWS,
        R_world_cam_predicted=R_predicted, R_world_cam_truth=STILL,
    )  # fmt: skip


def test_position_and_the_heading_of_body_and_camera_together_do_not_count() -> None:
    R = rotvec_to_rotmat(np.array([0.3, -0.5, 0.2]))
    moved = replace(REST, root_orient=np.tile(rotmat_to_rotvec(R), (N, 1)), transl=np.full((N, 3), 4.0))
    assert error_mm(moved, REST, np.tile(R, (N, 1, 1))) < 1e-3  # mm; single precision


def test_a_rotated_body_is_off_by_how_far_its_skin_moves() -> None:
    R = rotvec_to_rotmat(np.array([0.0, 0.4, 0.0]))
    turned = replace(REST, root_orient=np.tile(rotmat_to_rotvec(R), (N, 1)))
    body = load_body()
    about_hips = body.rest_vertices(np.zeros(10)) - body.rest_joints(np.zeros(10))[1:3].mean(axis=0)
    wanted = 1000 * np.linalg.norm(about_hips @ R.T - about_hips, axis=-1).mean()
    assert error_mm(turned, REST) == pytest.approx(wanted, rel=1e-4)


def test_other_bodies_and_none_have_no_figure(sequence: MotionSequence) -> None:
    with pytest.raises(UndefinedFigureError, match="no body parameters"):
        error_mm(None, sequence.people[0].body)
    with pytest.raises(UndefinedFigureError, match="not body24"):
        error_mm(replace(REST, model="smpl"), REST)
