"""Human3.6M from a miniature of its official folders: the cameras of <w0>, positions in CDF, clips."""

from collections.abc import Callable
from pathlib import Path

import cdflib.cdfwrite
import numpy as np
import pytest

from humanmm.errors import InputError
from humanmm.flows.bench.dataset_builder import build_clip
from humanmm.storage.readers.datasets import human36m
from humanmm.storage.readers.truth import read_sequence

FRAMES = 100
CENTRE_MM = np.array([1841.1, 4955.3, 1563.4])


@pytest.fixture
def root(tmp_path: Path, film: Callable[[Path, int, float, int], None]) -> Path:
    """S1 with one action of a hundred frames."""
    w0 = np.zeros(300)
    for camera in range(4):
        w0[6 * (11 * camera) :][:6] = [0.1 * camera, -0.2, 0.3, *(CENTRE_MM + camera)]
        w0[264 + 9 * camera :][:9] = [1145.0, 1143.8, 512.5, 515.5, 0, 0, 0, 0, 0]
    text = " ".join(f"{number:.6g}" for number in w0)
    (tmp_path / "metadata.xml").write_text(f"<database><w0>[{text}]</w0></database>")
    folder = tmp_path / "S1" / "MyPoseFeatures" / "D3_Positions"
    folder.mkdir(parents=True)
    pose = np.zeros((1, FRAMES, 96), np.float32)
    pose.reshape(FRAMES, 32, 3)[:, 6] = [130.0, 0.0, 900.0]  # the left hip
    file = cdflib.cdfwrite.CDF(folder / "Walking 1.cdf", cdf_spec={"Encoding": 6})
    file.write_var(
        {
            "Variable": "Pose", "Data_Type": 21, "Num_Elements": 1, "Rec_Vary": True,
            "Dim_Sizes": [FRAMES, 96], "Compress": 6,
        },
        var_data=pose,
    )  # fmt: skip
    file.close()
    for k, camera in enumerate(human36m.CAMERAS):
        film(tmp_path / "S1" / "Videos" / f"Walking 1.{camera}.mp4", FRAMES, 50.0, 50 + 40 * k)
    return tmp_path


def test_cameras_and_joints_are_in_metres(root: Path) -> None:
    assert human36m.sequence_names(root) == ["S1/Walking 1"]
    sequence = human36m.read_multiview(root, "S1/Walking 1")
    assert np.allclose(sequence.t_world_cam[2], (CENTRE_MM + 2) / 1000, atol=1e-4)
    assert np.allclose(sequence.people[0][:, sequence.joint_names.index("L_Hip")], [0.13, 0.0, 0.9])
    assert np.allclose(sequence.K[1], [[1145.0, 0, 512.5], [0, 1143.8, 515.5], [0, 0, 1]])
    a, b, c = 0.2, -0.2, 0.3  # of the third camera
    X = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    Y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    Z = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
    assert np.allclose(sequence.R_world_cam[2].T, X @ Y @ Z)


def test_a_clip_has_a_truth_that_can_be_read_and_the_same_seed_the_same_cuts(root: Path, tmp_path: Path) -> None:
    sequence = human36m.read_multiview(root, "S1/Walking 1")
    path, num_frames, fps = build_clip(sequence, 1, tmp_path / "out", seed=1)
    assert (num_frames, fps) == (50, 25.0)
    truth = read_sequence(path.with_name(f"{path.stem}_gt.npz"))
    again, _, _ = build_clip(sequence, 1, tmp_path / "again", seed=1)
    assert path.read_bytes() == again.read_bytes()
    assert truth.cut_frames == read_sequence(again.with_name(f"{again.stem}_gt.npz")).cut_frames
    with pytest.raises(InputError, match="too short for 9 cuts"):
        build_clip(sequence, 9, tmp_path / "out", seed=1)


def test_what_is_missing_is_named_with_where_to_get_it(root: Path) -> None:
    (root / "metadata.xml").write_text("<database/>")
    with pytest.raises(InputError, match=r"metadata\.xml is missing or holds no cameras"):
        human36m.read_multiview(root, "S1/Walking 1")
    (root / "S1" / "Videos" / "Walking 1.55011271.mp4").unlink()
    with pytest.raises(InputError, match=r"55011271\.mp4 is missing; get Human3\.6M"):
        human36m.read_multiview(root, "S1/Walking 1")
    with pytest.raises(InputError, match="D3_Positions"):
        human36m.sequence_names(root / "S1")
