"""3DPW from a miniature of its official folders."""

import pickle
from pathlib import Path

import cv2
import numpy as np
import pytest

from humanmm.cli import main
from humanmm.errors import InputError
from humanmm.storage.readers.datasets import threedpw
from humanmm.storage.readers.truth import read_sequence

FRAMES = 5


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """One sequence of two actors; the camera stands 3 m before the origin, level, 1 m high; y up."""
    (tmp_path / "sequenceFiles" / "test").mkdir(parents=True)
    folder = tmp_path / "imageFiles" / "cafe_00"
    folder.mkdir(parents=True)
    for frame in range(FRAMES):
        cv2.imwrite(str(folder / f"image_{frame:05d}.jpg"), np.full((64, 48, 3), 40 * frame, np.uint8))
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = np.diag([1.0, -1.0, -1.0]), [0.0, 1.0, 3.0]
    joints = np.zeros((FRAMES, 24, 3))
    joints[:, :, 1] = np.linspace(0.1, 1.7, 24)
    tree = {
        "sequence": "cafe_00", "cam_poses": np.tile(pose, (FRAMES, 1, 1)),
        "cam_intrinsics": np.array([[60.0, 0, 24], [0, 60, 32], [0, 0, 1]]),
        "jointPositions": [joints.reshape(FRAMES, 72), (joints + np.array([1.0, 0, 0])).reshape(FRAMES, 72)],
        "campose_valid": [np.ones(FRAMES, int), np.array([1, 1, 0, 0, 1])],
    }  # fmt: skip
    (tmp_path / "sequenceFiles" / "test" / "cafe_00.pkl").write_bytes(pickle.dumps(tree, protocol=2))
    return tmp_path


def test_a_sequence_becomes_a_video_beside_a_truth_with_z_up(root: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert main(["dataset", "build", "3dpw", "--root", str(root), "--out", str(out)]) == 0
    truth = read_sequence(out / "cafe_00_gt.npz")
    assert (out / "cafe_00.mp4").stat().st_size > 0
    assert (truth.num_frames, len(truth.people), truth.cut_frames) == (FRAMES, 2, ())
    assert truth.people[0].joints[0, -1] == pytest.approx([0.0, 0.0, 1.7])
    assert truth.people[1].observed.tolist() == [True, True, False, False, True]
    assert truth.cameras is not None
    assert truth.cameras.t_world_cam[0] == pytest.approx([0.0, -3.0, 1.0])
    down, looking = truth.cameras.R_world_cam[0][:, 1], truth.cameras.R_world_cam[0][:, 2]
    assert looking == pytest.approx([0.0, 1.0, 0.0])
    assert down == pytest.approx([0.0, 0.0, -1.0])


def test_a_missing_picture_is_named(root: Path) -> None:
    (root / "imageFiles" / "cafe_00" / "image_00003.jpg").unlink()
    with pytest.raises(InputError, match=r"image_00003\.jpg is missing; get 3DPW"):
        threedpw.read_recording(root, root / "sequenceFiles" / "test" / "cafe_00.pkl")
    with pytest.raises(InputError, match="holds no <split>"):
        threedpw.sequence_files(root / "imageFiles")
