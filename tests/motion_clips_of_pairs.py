"""Fitted windows and clips for tests of the motion networks' training: fits with errors that are known."""

from functools import cache

import numpy as np
from pair_windows import pair_arrays

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import seen_rotations
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.learning.motion_clips import ClipSource, Take, error_windows

OFF_RAD, OFF_M = 0.1, 0.1


@cache
def fitted_arrays() -> dict[str, np.ndarray]:
    """Pairs whose fits have roots OFF_RAD and pelves OFF_M off; in the last window the fit faces backwards."""
    arrays = dict(pair_arrays())
    W, n = arrays["time_s"].shape
    turn = np.full(W, OFF_RAD)
    turn[-1] = np.pi
    R = rotvec_to_rotmat(turn[:, None] * [0.0, 1.0, 0.0])[:, None]
    fits = {
        "observed": np.ones((W, n), bool), "fitted": np.ones((W, n), bool),
        "R_cam_root_fitted": arrays["R_cam_root"] @ R, "body_pose_fitted": arrays["body_pose"],
        "pelvis_cam_fitted": arrays["joints_cam"][:, :, 0] + [0.0, 0.0, OFF_M],
        "confidence_fitted": np.full((W, n), 0.7), "betas_fitted": arrays["betas"],
    }  # fmt: skip
    return arrays | {k: v if v.dtype == bool else v.astype(np.float32) for k, v in fits.items()}


def source(*, varied: bool = False) -> ClipSource:
    """Clips of these windows and of a take: the first window's motion, longer."""
    arrays = fitted_arrays()
    R = seen_rotations(arrays["R_world_cam"][0] @ arrays["R_cam_root"][0], arrays["body_pose"][0])
    pelvis = np.einsum("nij,nj->ni", arrays["R_world_cam"][0], arrays["joints_cam"][0, :, 0])
    rest = load_body().rest_joints(np.zeros(10)).astype(np.float32)
    order = np.tile(np.r_[0 : len(R), len(R) - 2 : 0 : -1], 12)
    take = Take(15.0, R[order].astype(np.float32), pelvis[order], np.ones((len(order), 4)), rest)
    return ClipSource([take], error_windows(arrays), whole=0.5, varied=varied)
