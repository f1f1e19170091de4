"""RICH from a miniature of its documented folders, on SMPL-X models made of their joints alone."""

import json
import pickle
from pathlib import Path

import cv2
import numpy as np
import pytest

from humanmm.cli import main
from humanmm.errors import InputError
from humanmm.models.body.body24 import load_body
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.storage.readers.datasets import rich
from humanmm.storage.readers.datasets.smpl_joints import read_smplx
from humanmm.storage.readers.truth import read_sequence

FRAMES = range(3, 8)
MISSING = 5
WIDTH, HEIGHT = 48, 32
R_WORLD_RIG = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
"""The first camera is the rig: level, its z is the world's y."""
CENTRE_RIG = np.array([0.5, 0.2, -1.0])
MATRIX = (
    '<{name} type_id="opencv-matrix"><rows>{rows}</rows><cols>{cols}</cols><dt>d</dt>\n<data>{numbers}</data></{name}>'
)


def matrix(name: str, values: np.ndarray) -> str:
    numbers = " ".join(repr(float(value)) for value in values.ravel())
    return MATRIX.format(name=name, rows=len(values), cols=len(values[0]), numbers=numbers)


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A woman and a man in a lecture hall; camera 0 is the rig, camera 2 is turned and pictured at half its size,
    camera 4 moves; the woman is missing in a frame."""
    name = "LectureHall_009_011_wiping1"
    parameters = {
        "betas": np.full((1, 10), 0.5, np.float32), "global_orient": np.array([[np.pi, 0, 0]], np.float32),
        "body_pose": np.zeros((1, 63), np.float32), "pose_embedding": np.zeros((1, 32), np.float32),
    }  # fmt: skip
    for frame in FRAMES:
        folder = tmp_path / "bodies" / "test" / name / f"{frame:05d}"
        folder.mkdir(parents=True)
        for subject, x in (("009", 0.0), ("011", 50.0)):
            if (subject, frame) != ("009", MISSING):
                transl = np.array([[x, 0, 4.0]], np.float32)
                (folder / f"{subject}.pkl").write_bytes(pickle.dumps(parameters | {"transl": transl}))
    for camera, shrink in ((0, 1), (2, 2), (4, 1)):
        folder = tmp_path / "images" / "test" / name / f"cam_{camera:02d}"
        folder.mkdir(parents=True)
        for frame in FRAMES:
            picture = np.full((HEIGHT // shrink, WIDTH // shrink, 3), 20 * frame, np.uint8)
            cv2.imwrite(str(folder / f"{frame:05d}_{camera:02d}.png"), picture)
    calibration = tmp_path / "scan_calibration" / "LectureHall" / "calibration"
    calibration.mkdir(parents=True)
    K = np.array([[60.0, 0, WIDTH / 2 - 0.5], [0, 60, HEIGHT / 2 - 0.5], [0, 0, 1]])
    R = rotvec_to_rotmat(np.array([0.0, 0.3, 0.0]))
    poses = {0: np.eye(3, 4), 2: np.column_stack([R, -R @ CENTRE_RIG])}
    for camera, pose in poses.items():
        text = matrix("CameraMatrix", pose) + matrix("Intrinsics", K) + matrix("Distortion", np.zeros((5, 1)))
        (calibration / f"{camera:03d}.xml").write_text(f'<?xml version="1.0"?><opencv_storage>{text}</opencv_storage>')
    world = {"R": np.round(R_WORLD_RIG.T, 3).tolist(), "t": [0.0, 0.0, 2.0], "c": 1.25}
    (tmp_path / "multicam2world").mkdir()
    (tmp_path / "multicam2world" / "LectureHall_chair_multicam2world.json").write_text(json.dumps(world))
    (tmp_path / "models").mkdir()
    body = load_body()
    regressor = np.zeros((55, 24))
    regressor[[*range(22), 28, 43], range(24)] = 1.0
    for sex, size in (("FEMALE", 1.0), ("MALE", 1.1)):
        np.savez(
            tmp_path / "models" / f"SMPLX_{sex}.npz",
            v_template=size * body.J_template,
            shapedirs=size * body.J_shapedirs.transpose(1, 2, 0),
            J_regressor=regressor,
        )
    return tmp_path


def test_each_static_camera_becomes_a_video_beside_a_truth_in_the_upright_world(root: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    command = ["dataset", "build", "rich", "--root", str(root), "--split", "test", "--smplx", str(root / "models")]
    assert main([*command, "--out", str(out)]) == 0
    assert sorted(path.stem[-6:] for path in out.glob("*.mp4")) == ["cam_00", "cam_02"]
    first, second = (read_sequence(out / f"LectureHall_009_011_wiping1_cam_{n:02d}_gt.npz") for n in (0, 2))
    rest = load_body().rest_joints(np.full(10, 0.5))
    in_rig = (rest - rest[0]) @ np.diag([1.0, -1.0, -1.0]) + rest[0] + np.array([0.0, 0.0, 4.0])
    assert first.people[0].joints[0] == pytest.approx(in_rig @ R_WORLD_RIG.T + [0.0, 0.0, 1.6], abs=1e-5)
    tall = first.people[1].joints[0]
    assert np.ptp(tall[:, 2]) == pytest.approx(1.1 * np.ptp(first.people[0].joints[0][:, 2]), abs=1e-5)
    seen = [n != MISSING for n in FRAMES]
    assert first.people[0].observed.tolist() == seen
    assert not first.people[1].observed.any()  # 50 m beside it
    assert first.cameras is not None and second.cameras is not None
    assert first.cameras.t_world_cam[0] == pytest.approx([0.0, 0.0, 1.6])
    assert second.cameras.t_world_cam[0] == pytest.approx(R_WORLD_RIG @ CENTRE_RIG + [0.0, 0.0, 1.6])
    assert second.cameras.R_world_cam[0][:, 2] == pytest.approx([-np.sin(0.3), np.cos(0.3), 0.0])
    assert second.cameras.K[0][0] == pytest.approx([30.0, 0.0, WIDTH / 4])
    assert second.people[0].joints[seen] == pytest.approx(first.people[0].joints[seen], abs=1e-5)


def _read(root: Path) -> object:
    models = rich.Models(*(read_smplx(root / "models" / f"SMPLX_{sex}.npz") for sex in ("FEMALE", "MALE")))
    return rich.read_recording(rich.views(root, "test")[0], models)


@pytest.mark.parametrize(
    ("gone", "message"),
    [
        ("multicam2world/LectureHall_chair_multicam2world.json", "multicam2world.json is missing"),
        ("scan_calibration/LectureHall/calibration/000.xml", "no camera of .* has a file in scan_calibration"),
        ("images/test/LectureHall_009_011_wiping1/cam_00/00004_00.png", "one step throughout"),
        ("models/SMPLX_MALE.npz", "get SMPL-X"),
    ],
)
def test_what_is_missing_is_named(root: Path, gone: str, message: str) -> None:
    (root / "scan_calibration" / "LectureHall" / "calibration" / "002.xml").unlink()
    (root / gone).unlink()
    with pytest.raises(InputError, match=message):
        _read(root)


def test_a_world_with_another_axis_up_is_refused(root: Path) -> None:
    path = root / "multicam2world" / "LectureHall_chair_multicam2world.json"
    path.write_text(json.dumps({"R": np.diag([1.0, -1, -1]).tolist(), "t": [0, 0, 0], "c": 1}))
    models = rich.Models(*(read_smplx(root / "models" / f"SMPLX_{sex}.npz") for sex in ("FEMALE", "MALE")))
    with pytest.raises(InputError, match="upright in a world z up"):
        rich.read_recording(rich.views(root, "test")[0], models)
