"""Camera errors against evo (the field's own tool) and against known answers."""

import dataclasses

import numpy as np
import pytest
from evo.core import metrics, trajectory

from humanmm.models.evaluation import cameras
from humanmm.models.geometry.alignment import yaw_to_rotmat
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.records.sequence import CameraSequence, MotionSequence, UndefinedFigureError


@pytest.fixture
def truth(sequence: MotionSequence) -> CameraSequence:
    assert sequence.cameras is not None
    return sequence.cameras


@pytest.fixture
def noisy(truth: CameraSequence) -> CameraSequence:
    rng = np.random.default_rng(4)
    n = len(truth.t_world_cam)
    R = truth.R_world_cam @ rotvec_to_rotmat(0.01 * rng.normal(size=(n, 3)))
    t = 0.8 * truth.t_world_cam @ yaw_to_rotmat(1.0).T + 0.02 * rng.normal(size=(n, 3)) + [3.0, 1.0, 0.0]
    return CameraSequence(yaw_to_rotmat(1.0) @ R, t, truth.K * [[1.1, 1.0, 1.0], [1.0, 1.1, 1.0], [1.0, 1.0, 1.0]])


def poses(sequence: CameraSequence) -> trajectory.PosePath3D:
    matrices = np.tile(np.eye(4), (len(sequence.t_world_cam), 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = sequence.R_world_cam, sequence.t_world_cam
    return trajectory.PosePath3D(poses_se3=list(matrices))


def evo_rpe(predicted: CameraSequence, truth: CameraSequence, relation: metrics.PoseRelation) -> float:
    rpe = metrics.RPE(relation, delta=1, delta_unit=metrics.Unit.frames, all_pairs=True)
    rpe.process_data((poses(truth), poses(predicted)))
    return float(rpe.get_statistic(metrics.StatisticsType.rmse))


def test_absolute_error_is_evos(truth: CameraSequence, noisy: CameraSequence) -> None:
    reference, estimate = poses(truth), poses(noisy)
    estimate.align(reference, correct_scale=True)
    ape = metrics.APE(metrics.PoseRelation.translation_part)
    ape.process_data((reference, estimate))
    ours = cameras.absolute_trajectory_error_m(noisy.t_world_cam, truth.t_world_cam)
    assert ours == pytest.approx(ape.get_statistic(metrics.StatisticsType.rmse), rel=1e-9)


def test_step_errors_are_evos_shot_by_shot(truth: CameraSequence, noisy: CameraSequence) -> None:
    shots = ((0, 60), (60, 130))
    parts = [
        [CameraSequence(c.R_world_cam[a:b], c.t_world_cam[a:b], c.K[a:b]) for c in (noisy, truth)] for a, b in shots
    ]
    rotation = np.mean([evo_rpe(p, t, metrics.PoseRelation.rotation_angle_deg) for p, t in parts])
    translation = np.mean([evo_rpe(p, t, metrics.PoseRelation.translation_part) for p, t in parts])
    ours = cameras.relative_pose_errors(noisy, truth, shots=shots, usable=np.ones(130, bool))
    assert ours == pytest.approx((rotation, translation), rel=1e-6)


def test_a_video_that_begins_with_a_transition_has_no_steps_before_it(truth: CameraSequence) -> None:
    usable = np.ones(len(truth.t_world_cam), bool)
    whole, first = ((5, len(usable)),), ((0, 0), (5, len(usable)))
    expected = cameras.relative_pose_errors(truth, truth, shots=whole, usable=usable)
    assert cameras.relative_pose_errors(truth, truth, shots=first, usable=usable) == expected


def test_a_camera_that_never_moves_has_no_absolute_error() -> None:
    still = np.tile([1.0, 2.0, 3.0], (10, 1))
    with pytest.raises(UndefinedFigureError, match="never moves"):
        cameras.absolute_trajectory_error_m(still, still)


def test_a_wrong_rotation_at_the_cut_is_found_whatever_the_world(truth: CameraSequence) -> None:
    R = rotvec_to_rotmat([0.1, 0.5, -0.2]) @ truth.R_world_cam
    R[60:] = R[60:] @ rotvec_to_rotmat([0.0, np.radians(25), 0.0])
    wrong = dataclasses.replace(truth, R_world_cam=R)
    usable = np.ones(130, bool)
    assert cameras.cut_rotation_errors_deg(wrong, truth, transitions=((60, 60),), usable=usable) == pytest.approx(
        [25.0]
    )
    drift = cameras.shot_drift_deg(wrong, truth, shots=((0, 60), (60, 130)), usable=usable)
    assert drift == pytest.approx(0.0, abs=1e-6)


def test_a_dissolve_is_judged_by_the_cameras_before_and_after_it(truth: CameraSequence) -> None:
    """The middle of a dissolve that was found two frames late is no error of the rotation, nor inside a shot."""
    R = truth.R_world_cam.copy()
    R[60:] = R[60:] @ rotvec_to_rotmat([0.0, 1.2, 0.0])
    late = R.copy()
    late[60:62] = R[59]
    sides, usable = [dataclasses.replace(truth, R_world_cam=one) for one in (late, R)], np.ones(130, bool)
    as_a_cut = cameras.cut_rotation_errors_deg(*sides, transitions=((60, 60),), usable=usable)
    assert as_a_cut[0] is not None and as_a_cut[0] > 30
    found = cameras.cut_rotation_errors_deg(*sides, transitions=((54, 66),), usable=usable)
    assert found == pytest.approx([0.0], abs=1e-6)
    sequence = MotionSequence(130, 30.0, (), (), ((54, 66),))
    assert sequence.shots_outside_transitions == ((0, 54), (66, 130))
    drift = cameras.shot_drift_deg(*sides, shots=sequence.shots_outside_transitions, usable=usable)
    assert drift == pytest.approx(0.0, abs=1e-6)


def test_drift_is_measured_from_the_first_frame_of_the_shot(truth: CameraSequence) -> None:
    drift = np.radians(np.linspace(0, 7, 130))[:, None] * [0.0, 1.0, 0.0]
    wrong = dataclasses.replace(truth, R_world_cam=truth.R_world_cam @ rotvec_to_rotmat(drift))
    found = cameras.shot_drift_deg(wrong, truth, shots=((0, 60), (60, 130)), usable=np.ones(130, bool))
    assert found == pytest.approx(7 * 69 / 129, abs=0.2)  # the orbit turns the axis of the drift a little


def test_frames_without_a_camera_are_left_out(truth: CameraSequence) -> None:
    t = truth.t_world_cam.copy()
    t[10:60] = np.nan
    usable = cameras.known(dataclasses.replace(truth, t_world_cam=t))
    assert usable.sum() == 80
    errors = cameras.cut_rotation_errors_deg(truth, truth, transitions=((60, 60), (100, 100)), usable=usable)
    assert errors == [None, pytest.approx(0.0, abs=1e-6)]


def test_the_focal_error_is_a_fraction_of_the_true_one(truth: CameraSequence, noisy: CameraSequence) -> None:
    assert cameras.focal_error_pct(noisy.K, truth.K) == pytest.approx(10.0)


def test_inside_a_shot_the_trajectory_is_evos_after_its_similarity(
    truth: CameraSequence, noisy: CameraSequence
) -> None:
    n = len(truth.t_world_cam)
    ate_m, rpe_m = cameras.errors_inside_shots_m(noisy, truth, shots=[(0, n)], usable=np.ones(n, bool))
    aligned, reference = poses(noisy), poses(truth)
    aligned.align(reference, correct_scale=True)
    ape = metrics.APE(metrics.PoseRelation.translation_part)
    ape.process_data((reference, aligned))
    assert ate_m == pytest.approx(ape.get_statistic(metrics.StatisticsType.rmse), rel=1e-6)
    steps = np.diff(aligned.positions_xyz, axis=0) - np.diff(reference.positions_xyz, axis=0)
    assert rpe_m == pytest.approx(np.sqrt((steps**2).sum(axis=1).mean()), rel=1e-6)


def test_every_shot_has_a_similarity_of_its_own_and_standing_ones_do_not_count(truth: CameraSequence) -> None:
    n = len(truth.t_world_cam)
    half = n // 2
    t = 2.0 * truth.t_world_cam
    t[half:] = 0.5 * truth.t_world_cam[half:] + [5.0, 0.0, 0.0]
    other = dataclasses.replace(truth, t_world_cam=t)
    usable = np.ones(n, bool)
    assert cameras.errors_inside_shots_m(other, truth, shots=[(0, half), (half, n)], usable=usable) == pytest.approx(
        (0.0, 0.0), abs=1e-9
    )
    standing = dataclasses.replace(truth, t_world_cam=np.zeros((n, 3)))
    with pytest.raises(UndefinedFigureError, match="moves in no shot"):
        cameras.errors_inside_shots_m(other, standing, shots=[(0, n)], usable=usable)


def test_two_places_are_neither_one_nor_three() -> None:
    places = np.array([[0.0, 0.0, 1.0], [3.0, 0.0, 1.0], [0.0, 3.0, 1.0]])
    visited = {1: [0, 0, 0], 2: [0, 1, 1, 0], 3: [0, 1, 2, 0]}
    assert {count: cameras.stands_in_two_places(places[rows]) for count, rows in visited.items()} == {
        1: False, 2: True, 3: False,
    }  # fmt: skip
