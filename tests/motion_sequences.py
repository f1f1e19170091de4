"""Motion for tests of the motion networks: somebody who swings arms and legs and goes on a circle."""

import numpy as np
import torch

from humanmm.models.body.body24 import ROTATED_JOINTS, load_body
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.networks.interfaces import AlignedMotion
from humanmm.models.motion.networks.sequence import MotionSequence

UPRIGHT = np.array([np.pi / 2, 0.0, 0.0])


def aligned(frames: int = 40, fps: float = 30.0) -> AlignedMotion:
    """So many frames at a rate."""
    time_s = np.arange(frames) / fps
    joints = len(ROTATED_JOINTS)
    phase = np.random.default_rng(3).uniform(0, 6, (joints, 3))
    rotations = rotvec_to_rotmat(0.3 * np.sin(2 * time_s[:, None, None] + phase))
    heading = rotvec_to_rotmat(0.4 * time_s[:, None] * [0.0, 0.0, 1.0])
    rotations[:, 0] = heading @ rotvec_to_rotmat(UPRIGHT) @ rotations[:, 0]
    pelvis = np.column_stack([np.sin(time_s), np.cos(time_s), 0.9 + 0.02 * np.sin(5 * time_s)])
    return AlignedMotion(
        rotations, pelvis, load_body().rest_joints(np.zeros(10)), time_s, np.ones(frames, bool), np.full(frames, 0.8),
        np.zeros(frames, int),
    )  # fmt: skip


def sequence(frames: int = 40) -> MotionSequence:
    """The same as networks take it."""
    motion = aligned(frames)

    def tensor(values: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(np.asarray(values, np.float32))[None]

    return MotionSequence(
        tensor(motion.rotations), tensor(motion.pelvis), tensor(motion.rest_joints),
        torch.from_numpy(motion.known)[None], tensor(motion.confidence), torch.from_numpy(motion.shot)[None],
    )  # fmt: skip
