"""AIST++ from a miniature of its official folders: arrays for bench ms-aist, clips with truths from the videos."""

import json
import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from humanmm.cli import main
from humanmm.errors import InputError
from humanmm.models.video.frames import frames
from humanmm.models.video.reading import read_facts
from humanmm.storage.readers.aist import read_aist_sequence
from humanmm.storage.readers.datasets import aistpp
from humanmm.storage.readers.truth import read_sequence

NAME = "gBR_sBM_cAll_d06_mBR2_ch06"
FRAMES = 180
LUMA = (60, 120, 180)


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """Three cameras 4 m from the origin, 120° apart, one dancer who moves along x; axes and units of AIST++."""
    folder = tmp_path / "annotations"
    for name in ("cameras", "keypoints2d", "keypoints3d"):
        (folder / name).mkdir(parents=True)
    cameras = [
        {
            "name": f"c{k + 1:02d}", "size": [1920, 1080], "matrix": [[1000, 0, 960], [0, 1000, 540], [0, 0, 1]],
            "rotation": [0.0, 2 * np.pi * k / 3, 0.0], "translation": [0.0, 90.0, 400.0], "distortions": [0.0] * 5,
        }
        for k in range(3)
    ]  # fmt: skip
    (folder / "cameras" / "setting1.json").write_text(json.dumps(cameras))
    (folder / "cameras" / "mapping.txt").write_text(f"{NAME} setting1\nother setting1\n")
    (folder / "ignore_list.txt").write_text("other\n")
    joints = np.random.default_rng(0).normal(100, 30, (FRAMES, 17, 3))
    joints[:, :, 0] += np.arange(FRAMES)[:, None]
    of_2d = {
        "keypoints2d": np.zeros((3, FRAMES, 17, 3)), "det_scores": np.ones((3, FRAMES)),
        "timestamps": np.arange(FRAMES) * 16667,
    }  # fmt: skip
    for name in (NAME, "other"):
        (folder / "keypoints3d" / f"{name}.pkl").write_bytes(
            pickle.dumps({"keypoints3d": joints, "keypoints3d_optim": joints})
        )
        (folder / "keypoints2d" / f"{name}.pkl").write_bytes(pickle.dumps(of_2d))
    return folder


def test_sequences_on_the_ignore_list_are_left_out_and_arrays_are_as_the_table_reads_them(
    root: Path, tmp_path: Path
) -> None:
    assert aistpp.sequence_names(root) == [NAME]
    assert main(["dataset", "build", "ms-aist", "--root", str(root), "--out", str(tmp_path / "out")]) == 0
    with np.load(tmp_path / "out" / f"{NAME}.npz", allow_pickle=False) as arrays:
        assert arrays["keypoints2d"].shape == (3, FRAMES, 17, 3)
        assert (arrays["cam_K"].shape, arrays["cam_t"].shape, float(arrays["fps"])) == ((3, 3, 3), (3, 3), 60.0)
    sequence = read_aist_sequence(tmp_path / "out" / f"{NAME}.npz")
    assert (sequence.fps, sequence.joints.shape) == (30.0, (FRAMES // 2, 17, 3))
    assert main(["dataset", "build", "ms-aist", "--root", str(root), "--out", str(tmp_path / "out")]) == 1


def test_clips_show_another_camera_after_every_cut_and_their_truth_is_in_metres_with_z_up(
    root: Path, tmp_path: Path, film: Callable[[Path, int, float, int], None]
) -> None:
    videos, out = tmp_path / "videos", tmp_path / "out"
    for k, luma in enumerate(LUMA):
        film(videos / f"{NAME.replace('cAll', f'c{k + 1:02d}')}.mp4", FRAMES, 60.0, luma)
    command = ["dataset", "build", "ms-aist", "--root", str(root), "--videos", str(videos), "--out", str(out)]
    assert main(command) == 0
    clips = sorted((out / "clips").glob("*.mp4"))
    assert [clip.stem for clip in clips] == [f"{NAME}-{count}" for count in (2, 3, 4)]
    truth = read_sequence(clips[0].with_name(f"{clips[0].stem}_gt.npz"))
    assert (truth.num_frames, truth.fps, len(truth.cut_frames)) == (90, 30.0, 2)
    with clips[0].open("rb") as stream:
        seen = [float(frame.image.mean()) for frame in frames(stream, read_facts(stream), pixels="gray")]
    gray = [(luma - 16) * 255 / 219 for luma in LUMA]
    camera = [int(np.abs(np.array(gray) - value).argmin()) for value in seen]
    assert tuple(k for k in range(1, 90) if camera[k] != camera[k - 1]) == truth.cut_frames
    joints = truth.people[0].joints
    assert joints[..., 2].mean() == pytest.approx(1.0, abs=0.05)  # AIST++'s y, in centimetres
    assert np.polyfit(np.arange(90), joints[:, :, 0].mean(axis=1), 1)[0] == pytest.approx(0.02, abs=0.001)
    angle = 2 * np.pi * np.array(camera) / 3
    # the camera's centre −Rᵀt with t = (0, 0.9, 4) and y up; x → x, y → z, z → −y
    centre = np.stack([4 * np.sin(angle), 4 * np.cos(angle), np.full(90, -0.9)], axis=1)
    assert truth.cameras is not None
    assert np.allclose(truth.cameras.t_world_cam, centre, atol=1e-6)


def test_what_is_missing_is_named_with_where_to_get_it(root: Path, tmp_path: Path) -> None:
    (root / "cameras" / "setting1.json").unlink()
    with pytest.raises(InputError, match=r"setting1\.json is missing.*AIST\+\+"):
        aistpp.read_arrays(root, NAME)
    with pytest.raises(InputError, match=r"keypoints3d is missing"):
        aistpp.sequence_names(tmp_path)
