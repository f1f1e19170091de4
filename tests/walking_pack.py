"""Fixtures: a pack of motion capture made of arithmetic: people who walk in a circle and swing their arms.

Tests only read it, so one is made for all.
"""

from pathlib import Path

import numpy as np
import pytest

from humanmm.models.body.body24 import PARENTS, load_body
from humanmm.models.synthetic.mocap import MocapSequence
from humanmm.storage.readers.mocap_pack import read_pack


def _walk(num_frames: int, pace: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Poses (N,24,3), pelvis (N,3) and contacts (N,4) of a walk in a circle, world y up."""
    t = np.arange(num_frames) / 30
    phase = 2 * np.pi * pace * t
    poses = np.zeros((num_frames, 24, 3))
    heading = 0.4 * t
    poses[:, 0, 1] = heading
    for joint, sign in ((1, 1.0), (2, -1.0)):
        poses[:, joint, 0] = -0.5 * sign * np.sin(phase)
        poses[:, joint + 3, 0] = 0.4 * (1 - sign * np.cos(phase))
    poses[:, 16, 2], poses[:, 17, 2] = -1.2, 1.2
    poses[:, 16, 1], poses[:, 17, 1] = 0.4 * np.sin(phase), 0.4 * np.sin(phase)
    speed = 1.0
    step = speed / 30 * np.stack([np.sin(heading), np.zeros(num_frames), np.cos(heading)], axis=1)
    pelvis = np.cumsum(step, axis=0) + np.array([0, 0.92, 0])
    left = np.cos(phase) > 0
    return poses, pelvis, np.stack([left, left, ~left, ~left], axis=1)


@pytest.fixture(scope="session")
def pack(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two walks of 100 and 150 frames, as an npz."""
    walks = [_walk(100, 0.9), _walk(150, 1.1)]
    poses, trans, contacts = (np.concatenate(parts) for parts in zip(*walks, strict=True))
    path = tmp_path_factory.mktemp("mocap") / "pack.npz"
    np.savez(
        path,
        poses=poses.reshape(-1, 72).astype(np.float32),
        trans=trans.astype(np.float32),
        contacts=contacts.astype(np.uint8),
        clip_start=np.array([0, 100], np.int32),
        clip_len=np.array([100, 150], np.int32),
        clip_name=np.array(["slow", "quick"]),
        rest_joints=load_body().J_template.astype(np.float32),
        parents=np.array(PARENTS, np.int32),
        fps=np.float32(30),
    )
    return path


@pytest.fixture(scope="session")
def sequences(pack: Path) -> tuple[MocapSequence, ...]:
    """The same, read."""
    return read_pack(pack)
