"""Windows of pairs for tests: somebody who walks on a circle, and a pose network with known errors."""

from functools import cache

import numpy as np

from humanmm.models.body.body24 import NUM_JOINTS, load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.body.landmarks import load_landmarks
from humanmm.models.geometry.projection import project
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.learning.other_motion import Take
from humanmm.models.records.landmarks import SWAP

WINDOWS, FRAMES = 4, 8
K = np.array([[500.0, 0, 320], [0, 500, 180], [0, 0, 1]])
R_WORLD_CAM = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
"""A level camera that looks along +y."""


@cache
def pair_arrays() -> dict[str, np.ndarray]:
    """Arrays of a set of pairs; in the last window left and right are swapped."""
    rng = np.random.default_rng(0)
    body, model, betas = load_body(), load_landmarks(), np.zeros(10)
    rows: dict[str, list[np.ndarray]] = {}
    for window in range(WINDOWS):
        time_s = np.arange(FRAMES) / 15
        heading = rng.uniform(0, 2 * np.pi) + time_s
        upright = rotvec_to_rotmat(np.array([np.pi / 2, 0, 0]))  # y up to z up
        R_world_root = rotvec_to_rotmat(heading[:, None] * [0.0, 0, 1]) @ upright
        pose = 0.3 * np.sin(3 * time_s[:, None, None] + rng.uniform(0, 6, (NUM_JOINTS - 1, 3)))
        pelvis = np.stack([0.3 * np.cos(heading), 4 + 0.3 * np.sin(heading), np.full(FRAMES, 0.9)], axis=1)
        joints, R = forward_kinematics(body.rest_joints(betas), R_world_root, pose, pelvis)
        eye = np.array([0.0, 0.0, 1.2])
        truth = (model.place(betas, joints, R) - eye) @ R_WORLD_CAM
        pixels = project(truth, K, near_m=0.1)
        centre = pixels[:, [23, 24]].mean(axis=1)
        side = 2.5 * np.linalg.norm(pixels - centre[:, None], axis=-1).max(axis=1)
        hips = truth[:, [23, 24]].mean(axis=1, keepdims=True)
        keypoints = np.concatenate([pixels + rng.normal(0, 1.0, pixels.shape), np.ones((FRAMES, 33, 1))], axis=-1)
        landmarks = truth - hips + rng.normal(0, 0.02, truth.shape)
        if window == WINDOWS - 1:
            keypoints, landmarks = keypoints[:, SWAP], landmarks[:, SWAP]
        values = {
            "time_s": time_s, "K": np.tile(K, (FRAMES, 1, 1)), "R_world_cam": np.tile(R_WORLD_CAM, (FRAMES, 1, 1)),
            "t_world_cam": np.tile(eye, (FRAMES, 1)), "keypoints": keypoints, "landmarks3d": landmarks,
            "keypoint_sigma": np.ones((FRAMES, 33)),
            "region": np.column_stack([centre, side, np.zeros(FRAMES)]), "confidence": np.full(FRAMES, 0.9),
            "betas": betas, "body_pose": pose, "R_cam_root": R_WORLD_CAM.T @ R[:, 0], "truth_cam": truth,
            "contacts": np.zeros((FRAMES, 4)), "size": np.array([640.0, 360.0]),
            "joints_cam": (joints - eye) @ R_WORLD_CAM,
        }  # fmt: skip
        for name, value in values.items():
            rows.setdefault(name, []).append(value.astype(np.float32))
    return {name: np.stack(values) for name, values in rows.items()}


def walk() -> Take:
    """The first window's motion as a take, z up."""
    arrays = pair_arrays()
    R, t = arrays["R_world_cam"][0], arrays["t_world_cam"][0]
    landmarks = np.einsum("nij,nkj->nki", R, arrays["truth_cam"][0]) + t[:, None]
    rotations = np.tile(np.eye(3, dtype=np.float32), (len(t), 20, 1, 1))
    rotations[:, 0] = R @ arrays["R_cam_root"][0]
    return Take(15.0, landmarks, rotations, np.zeros((len(t), 4), np.float32))
