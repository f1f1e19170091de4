"""A project of Pose2Sim: its two calibrations say the same, what is wrong is named, clips show every two cameras."""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from humanmm.cli import main
from humanmm.errors import InputError
from humanmm.flows.bench import dataset_builder
from humanmm.models.evaluation.rig_truth import RigTrack
from humanmm.models.geometry.projection import project, world_to_camera
from humanmm.storage.readers.datasets.pose2sim import Rig, read_rig
from humanmm.storage.readers.truth import read_sequence

C, FRAMES, SIZE = 3, 120, (64, 48)
TURN = [Rotation.from_euler("zx", [120 * k, -95], degrees=True).as_matrix() for k in range(C)]
"""World to a camera's axes (x right, y down, z forward)."""
CENTRE = np.array([-4.0 * R[2] for R in TURN])
DISTORTION = (-0.1, 0.02, 0.001, -0.002, 0.0)
BENDS = (
    "radialDistortion1", "radialDistortion2", "tangentalDistortion1", "tangentalDistortion2", "radialDistortion3"
)  # fmt: skip


def toml() -> str:
    tables = []
    for k, (R, centre) in enumerate(zip(TURN, CENTRE, strict=True)):
        rotvec, t = cv2.Rodrigues(R)[0].ravel().tolist(), (-R @ centre).tolist()
        tables.append(
            f'[cam{k}]\nname = "cam{k}"\nsize = [{SIZE[0]}.0, {SIZE[1]}.0]\n'
            "matrix = [[60.0, 0.0, 31.5], [0.0, 61.0, 23.5], [0.0, 0.0, 1.0]]\n"
            f"distortions = {list(DISTORTION)}\nrotation = {rotvec}\ntranslation = {t}\nfisheye = false\n"
        )
    return "\n".join([*tables, "[metadata]\nadjusted = false\nerror = 0.0\n"])


def _attributes(values: Mapping[str, float]) -> str:
    return " ".join(f'{name}="{value}"' for name, value in values.items())


def qualisys() -> str:
    cameras = []
    for k, (R, centre) in enumerate(zip(TURN, CENTRE, strict=True)):
        rows = (np.diag([1.0, -1, -1]) @ R).tolist()
        turn = {f"r{i + 1}{j + 1}": rows[i][j] for i in range(3) for j in range(3)}
        place = dict(zip("xyz", (centre * 1000).tolist(), strict=True))
        lens = {"focalLengthU": 60, "focalLengthV": 61, "centerPointU": 31.5, "centerPointV": 23.5}
        lens |= dict(zip(BENDS, DISTORTION, strict=True))
        view = {"left": 0, "right": SIZE[0] - 1, "top": 0, "bottom": SIZE[1] - 1}
        subpixels = {name: 64 * value for name, value in lens.items()}
        elements = {"fov_video": view, "transform": turn | place, "intrinsic": subpixels}
        inner = "".join(f"<{tag} {_attributes(values)}/>" for tag, values in elements.items())
        cameras.append(f'<camera serial="cam{k}">{inner}</camera>')
    return f"<calibration><cameras>{''.join(reversed(cameras))}</cameras></calibration>"


@pytest.fixture
def project_folder(tmp_path: Path, film: Callable[[Path, int, float, int], None]) -> Path:
    root = tmp_path / "Trial_1"
    (root / "calibration").mkdir(parents=True)
    (root / "calibration" / "Calib_board.toml").write_text(toml())
    for k in range(C):
        film(root / "videos" / f"cam{k}.mp4", FRAMES, 60.0, 60 + 60 * k)
    return root


def test_both_calibrations_say_the_same(project_folder: Path) -> None:
    of_toml = read_rig(project_folder)
    (project_folder / "calibration" / "Calib.qca.txt").write_text(qualisys())
    of_qualisys = read_rig(project_folder)
    for name in ("K", "distortion", "size", "R_world_cam", "t_world_cam"):
        np.testing.assert_allclose(getattr(of_qualisys, name), getattr(of_toml, name), atol=1e-9, err_msg=name)
    assert of_toml.name == "Trial_1" and [video.stem for video in of_toml.videos] == ["cam0", "cam1", "cam2"]
    np.testing.assert_allclose(of_toml.t_world_cam, CENTRE, atol=1e-9)


def test_a_lens_is_taken_out_of_pixels(project_folder: Path) -> None:
    rig = read_rig(project_folder)
    point = np.array([[0.3, -0.2, 4.0], [1.0, 0.7, 4.0]])
    pixels = cv2.projectPoints(point, np.zeros(3), np.zeros(3), rig.K[1], rig.distortion[1])[0][:, 0]
    np.testing.assert_allclose(rig.ideal(1, pixels), point[:, :2] / point[:, 2:], atol=1e-4)
    assert 0.1 < rig.bend_px() < 10


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("Calib.toml", "[cam0]\n", r"Calib\.toml is no calibration of Pose2Sim"),
        ("Calib.toml", toml().replace("[0.0, 61.0, 23.5]", "[0.0, nan, 23.5]"), "values that are no numbers"),
        ("Calib.toml", toml().split("[cam2]")[0], "has 2 cameras.*3 videos"),
        ("Calib.qca.txt", "<calibration>", r"Calib\.qca\.txt is no calibration of Pose2Sim"),
        ("Calib.qca.txt", "<a><camera serial='1'/></a>", "a camera lacks intrinsic"),
    ],
)
def test_a_calibration_that_cannot_be_used_is_named(project_folder: Path, name: str, text: str, said: str) -> None:
    (project_folder / "calibration" / "Calib_board.toml").unlink()
    (project_folder / "calibration" / name).write_text(text)
    with pytest.raises(InputError, match=said):
        read_rig(project_folder)


def test_what_is_missing_is_named(tmp_path: Path, project_folder: Path) -> None:
    with pytest.raises(InputError, match=r"videos holds 0 videos"):
        read_rig(tmp_path)
    (project_folder / "calibration" / "Calib_board.toml").unlink()
    with pytest.raises(InputError, match=r"calibration holds no \*\.qca\.txt"):
        read_rig(project_folder)


def _build(root: Path, out: Path, folder: Path) -> list[str]:
    return ["dataset", "build", "pose2sim", "--root", str(root), "--out", str(out), "--store", str(folder / "store")]


def seen_by(rig: Rig, camera: int, *_: Any) -> Iterator[RigTrack]:
    """Somebody who moves a metre along x."""
    body = np.random.default_rng(0).normal(scale=[0.2, 0.2, 0.4], size=(12, 3))
    joints = body + np.linspace([-0.5, 0, 0], [0.5, 0, 0], FRAMES)[:, None]
    in_camera = world_to_camera(joints, rig.R_world_cam[[camera]], rig.t_world_cam[[camera]])
    xy = project(in_camera, np.eye(3), near_m=0.1)
    yield RigTrack(camera, np.arange(FRAMES), xy, np.ones((FRAMES, 12)), np.full(FRAMES, 0.5))


def test_a_clip_shows_one_camera_another_and_the_one_again_beside_the_truth(
    project_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(dataset_builder, "_seen_by", seen_by)
    out = tmp_path / "clips"
    command = _build(project_folder, out, tmp_path)
    assert main(command) == 0
    said = capsys.readouterr().out
    assert "person 0: 3 cameras see joints within 0.0 % of the height (median), 100 % of the frames are known" in said
    clips = sorted(path.stem for path in out.glob("*.mp4"))
    assert clips == ["Trial_1-cam0-cam1-cam0", "Trial_1-cam0-cam2-cam0", "Trial_1-cam1-cam2-cam1"]
    truth = read_sequence(out / "Trial_1-cam1-cam2-cam1_gt.npz")
    assert (truth.num_frames, truth.fps, truth.cut_frames) == (60, 30.0, (20, 40))
    assert truth.cameras is not None
    np.testing.assert_allclose(truth.cameras.t_world_cam[[0, 30, 50]], CENTRE[[1, 2, 1]], atol=1e-9)
    x = truth.people[0].joints[:, :, 0].mean(axis=1)
    assert x[-1] - x[0] == pytest.approx(1.0, abs=0.03)
    assert main(command) == 1 and "is not empty" in capsys.readouterr().err


def test_videos_that_do_not_belong_together_are_refused(
    project_folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    film: Callable[[Path, int, float, int], None],
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(dataset_builder, "_seen_by", lambda *_: iter(()))
    command = _build(project_folder, tmp_path / "clips", tmp_path)
    assert main(command) == 1 and "no 3 of its cameras see the same person" in capsys.readouterr().err
    film(project_folder / "videos" / "cam1.mp4", FRAMES, 25.0, 60)
    assert main(command) == 1 and "have 60, 25, 60 frames a second" in capsys.readouterr().err
    text = (project_folder / "calibration" / "Calib_board.toml").read_text().replace("size = [64.0", "size = [128.0")
    (project_folder / "calibration" / "Calib_board.toml").write_text(text)
    film(project_folder / "videos" / "cam1.mp4", FRAMES, 60.0, 60)
    assert main(command) == 1 and "its camera was calibrated for 128 x 48" in capsys.readouterr().err
