"""EMDB from a miniature of its documented folders, on an SMPL model made of its joints alone."""

import pickle
from pathlib import Path

import cv2
import numpy as np
import pytest

from humanmm.cli import main
from humanmm.errors import InputError
from humanmm.models.body.body24 import load_body
from humanmm.storage.readers.datasets import emdb
from humanmm.storage.readers.datasets.smpl_joints import read_smpl
from humanmm.storage.readers.truth import read_sequence

FRAMES = 4


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """One sequence of EMDB-2: a body that stands at x = 1 m, turned by a right angle; the camera looks along −z."""
    folder = tmp_path / "P2" / "24_outdoor_long_walk"
    (folder / "images").mkdir(parents=True)
    for frame in range(FRAMES):
        cv2.imwrite(str(folder / "images" / f"{frame:05d}.jpg"), np.full((64, 48, 3), 40 * frame, np.uint8))
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = np.diag([1.0, -1.0, -1.0]), [0.0, 1.0, 5.0]
    tree = {
        "gender": "male", "name": "P2_24_outdoor_long_walk", "emdb1": False, "emdb2": True, "n_frames": FRAMES,
        "good_frames_mask": np.array([True, True, False, True]),
        "camera": {"intrinsics": np.diag([60.0, 60, 1]), "extrinsics": np.tile(pose, (FRAMES, 1, 1))},
        "smpl": {
            "poses_root": np.tile([0.0, np.pi / 2, 0.0], (FRAMES, 1)), "poses_body": np.zeros((FRAMES, 69)),
            "trans": np.tile([1.0, 0.9, 0.0], (FRAMES, 1)), "betas": np.full(10, 0.5),
        },
        "kp2d": np.zeros((FRAMES, 24, 2)), "bboxes": {"bboxes": np.zeros((FRAMES, 4)), "invalid_idxs": np.array([2])},
    }  # fmt: skip
    (folder / "P2_24_outdoor_long_walk_data.pkl").write_bytes(pickle.dumps(tree))
    body = load_body()
    np.savez(
        tmp_path / "smpl.npz",
        v_template=body.J_template,
        shapedirs=body.J_shapedirs.transpose(1, 2, 0),
        J_regressor=np.eye(24),
    )
    return tmp_path


def test_a_sequence_becomes_a_video_beside_a_truth_with_z_up(root: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    command = ["dataset", "build", "emdb", "--root", str(root), "--split", "2", "--smpl", str(root / "smpl.npz")]
    assert main([*command, "--out", str(out)]) == 0
    truth = read_sequence(out / "P2_24_outdoor_long_walk_gt.npz")
    assert (out / "P2_24_outdoor_long_walk.mp4").stat().st_size > 0
    rest = load_body().rest_joints(np.full(10, 0.5))
    turned = np.stack([rest[:, 2], rest[:, 1], -rest[:, 0]], axis=1)  # a right angle about y
    wanted = turned - turned[0] + np.array([1.0, 0.9, 0.0]) + rest[0]
    assert truth.people[0].joints[0] == pytest.approx(np.stack([wanted[:, 0], -wanted[:, 2], wanted[:, 1]], axis=1))
    assert truth.people[0].observed.tolist() == [True, True, False, True]
    assert truth.cameras is not None
    assert truth.cameras.t_world_cam[0] == pytest.approx([0.0, -5.0, 1.0])


def test_a_split_without_sequences_and_a_file_that_is_missing_are_named(root: Path) -> None:
    with pytest.raises(InputError, match="belongs to EMDB-1"):
        emdb.sequence_files(root, 1)
    with pytest.raises(InputError, match=r"get SMPL \("):
        read_smpl(root / "none.npz")
    (path,) = emdb.sequence_files(root, 2)
    (path.parent / "images" / "00001.jpg").unlink()
    with pytest.raises(InputError, match=r"00001\.jpg is missing; get EMDB"):
        emdb.read_recording(path, read_smpl(root / "smpl.npz"))
