"""ms-AIST: a real sequence, from 2D detections alone; files that are none are refused."""

from pathlib import Path

import numpy as np
import pytest

from humanmm.config import Config
from humanmm.errors import InputError
from humanmm.models.benchmark.aist import build_aist
from humanmm.models.benchmark.methods import run_methods
from humanmm.models.perception.lifting.keypoints import lift_keypoints
from humanmm.models.synthetic.multishot import plan_videos
from humanmm.storage.readers.aist import read_aist, read_aist_sequence

SAMPLE = Path(__file__).parents[3] / "examples" / "aist"


def test_a_person_of_2d_keypoints_alone_is_recovered_with_a_warning() -> None:
    (sequence,) = read_aist(SAMPLE)
    plan = plan_videos([sequence], 1, seed=1, transitions=(1,), longest=45)[0]
    video = build_aist(sequence, plan, lifter=lift_keypoints)
    assert all(track.lifted for scene in video.people for track in scene.tracks)
    (done,) = run_methods(video, Config(), ("humanmm without refine",)).motions
    assert done.motion is not None, done.reason
    assert len(done.motion.people) == 1
    assert any("2D keypoints only" in warning for warning in done.motion.warnings)


def test_truth_and_cameras_agree_with_the_detections() -> None:
    (sequence,) = read_aist(SAMPLE)
    assert sequence.fps == 30.0
    for camera in range(len(sequence.K)):
        in_camera = (sequence.joints - sequence.t_world_cam[camera]) @ sequence.R_world_cam[camera]
        pixels = (in_camera @ sequence.K[camera].T)[..., :2] / in_camera[..., 2:]
        apart = np.linalg.norm(pixels - sequence.keypoints[camera, ..., :2], axis=-1)
        assert np.median(apart) < 10  # 3 to 8 px where the annotations were checked, lenses without distortion
    assert np.all(np.diff(sequence.joints[:, [15, 11, 5], 2].mean(axis=0)) > 0)  # ankles, hips, shoulders: z is up


def test_a_folder_or_file_that_is_none_is_one_plain_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"holds no \.npz"):
        read_aist(tmp_path)
    (tmp_path / "a.npz").write_bytes(b"no zip")
    with pytest.raises(InputError, match="cannot be read as an AIST"):
        read_aist(tmp_path)
    with np.load(SAMPLE / "gBR_sBM_cAll_d06_mBR2_ch06.npz") as file:
        arrays = dict(file)
    np.savez(tmp_path / "a.npz", **{**arrays, "cam_K": arrays["cam_K"][:3]})
    with pytest.raises(InputError, match="9 cameras"):
        read_aist_sequence(tmp_path / "a.npz")
    del arrays["keypoints3d_optim"]
    np.savez(tmp_path / "a.npz", **arrays)
    with pytest.raises(InputError, match="lacks keypoints3d"):
        read_aist_sequence(tmp_path / "a.npz")
