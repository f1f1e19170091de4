"""What motion networks read: kinematics as everywhere, and nothing of where a person is or faces."""

from dataclasses import replace

import numpy as np
import torch
from motion_sequences import sequence

from humanmm.models.body.body24 import ROTATED_JOINTS
from humanmm.models.body.kinematics import compose
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.networks.sequence import (
    PATH_FEATURES,
    POSE_FEATURES,
    joints_of,
    product,
    rotated,
)


def test_joints_are_those_of_the_bodys_kinematics() -> None:
    motion = sequence()
    R_local = np.tile(np.eye(3), (motion.rotations.shape[1], 24, 1, 1))
    R_local[:, list(ROTATED_JOINTS)] = motion.rotations[0].numpy()
    expected, _ = compose(motion.rest_joints[0].numpy(), R_local, motion.pelvis[0].numpy())
    np.testing.assert_allclose(joints_of(motion)[0].numpy(), expected, atol=1e-5)


def test_products_are_those_of_matrices() -> None:
    A, B = torch.randn(2, 4, 5, 3, 3, generator=torch.Generator().manual_seed(0))
    torch.testing.assert_close(product(A, B), A @ B)
    torch.testing.assert_close(rotated(A, B[..., 0]), (A @ B[..., :1])[..., 0])


def test_another_place_and_heading_change_nothing_and_a_lean_does() -> None:
    motion = sequence()
    assert motion.pose_features().shape[-1] == POSE_FEATURES and motion.path_features().shape[-1] == PATH_FEATURES

    def moved(vector: list[float]) -> torch.Tensor:
        R = torch.tensor(rotvec_to_rotmat(np.array(vector)), dtype=torch.float32)
        rotations = motion.rotations.clone()
        rotations[:, :, 0] = R @ rotations[:, :, 0]
        other = replace(motion, rotations=rotations, pelvis=motion.pelvis @ R.T + torch.tensor([3.0, -1.0, 0.0]))
        return torch.cat([other.pose_features(), other.path_features()], dim=-1)

    as_it_is = torch.cat([motion.pose_features(), motion.path_features()], dim=-1)
    torch.testing.assert_close(moved([0, 0, 1.3]), as_it_is, atol=2e-4, rtol=1e-4)
    assert (moved([0.3, 0, 0]) - as_it_is).abs().max() > 0.1


def test_nothing_is_read_from_a_step_over_a_cut() -> None:
    motion = sequence()
    half = motion.shot.shape[1] // 2
    jump = motion.pelvis.clone()
    jump[:, half:] += 5.0
    shot = motion.shot.clone()
    shot[:, half:] = 1
    cut = replace(motion, pelvis=jump, shot=shot)
    speeds = cut.path_features()[0, :, :15]
    assert speeds[half - 1].abs().max() == 0 and speeds.abs().max() < 3
