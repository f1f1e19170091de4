"""Parity with the published functions of WHAM and GVHMR: the same arrays give the same figures."""

from pathlib import Path

import numpy as np
import pytest

from humanmm.models.body.body24 import JOINT_NAMES
from humanmm.models.evaluation import pose, smoothness, trajectory
from humanmm.models.evaluation.skeleton import mid_hip

TOLERANCE = 1e-4
"""WHAM computes some of them in single precision."""


@pytest.fixture(scope="module")
def golden() -> dict[str, np.ndarray]:
    with np.load(Path(__file__).parents[2] / "data" / "golden_metrics.npz", allow_pickle=False) as file:
        return {key: file[key] for key in file}


def about_hips(joints: np.ndarray) -> np.ndarray:
    return joints - mid_hip(joints, JOINT_NAMES)[:, None]


def test_world_errors_are_those_of_wham(golden: dict[str, np.ndarray]) -> None:
    predicted, truth = golden["pred_joints"], golden["truth_joints"]
    wa = trajectory.chunked_mpjpe_mm(predicted, truth, align_frames=None)
    w = trajectory.chunked_mpjpe_mm(predicted, truth, align_frames=2)
    assert wa == pytest.approx(float(golden["wa_mpjpe100_mm"]), abs=TOLERANCE)
    assert w == pytest.approx(float(golden["w_mpjpe100_mm"]), abs=TOLERANCE)


def test_root_trajectory_error_is_that_of_wham(golden: dict[str, np.ndarray]) -> None:
    rte_pct = trajectory.root_trajectory_error_pct(golden["pred_joints"][:, 0], golden["truth_joints"][:, 0])
    assert rte_pct / 100 == pytest.approx(float(golden["rte_fraction_per_frame_mean"]), abs=TOLERANCE)


def test_pose_errors_are_those_of_gvhmr(golden: dict[str, np.ndarray]) -> None:
    predicted, truth = golden["pred_joints"], golden["truth_joints"]
    mpjpe = pose.point_error_mm(about_hips(predicted), about_hips(truth))
    assert pose.pa_mpjpe_mm(predicted, truth) == pytest.approx(float(golden["pa_mpjpe_mm_all24"]), abs=TOLERANCE)
    assert mpjpe == pytest.approx(float(golden["mpjpe_hip_centred_mm"]), abs=TOLERANCE)


def test_acceleration_and_jitter_are_those_of_gvhmr(golden: dict[str, np.ndarray]) -> None:
    predicted, truth, fps = golden["pred_joints"], golden["truth_joints"], float(golden["fps"])
    frame = np.arange(len(truth))
    acceleration = smoothness.acceleration_error_ms2(about_hips(predicted), about_hips(truth), frame=frame, fps=fps)
    jitter = smoothness.jitter_10ms3(predicted, frame=frame, fps=fps)
    assert acceleration == pytest.approx(float(golden["accel_ms2_hip_centred"]), abs=TOLERANCE)
    assert jitter == pytest.approx(float(golden["jitter_10ms3"]), abs=TOLERANCE)
