"""Cameras in TUM's and COLMAP's layouts, as pycolmap, evo and our own exports write them."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pycolmap
import pytest
from scipy.spatial.transform import Rotation
from two_people import recording

from humanmm.config import GivenFile
from humanmm.errors import InputError
from humanmm.models.motion.excerpt import Wishes, excerpt
from humanmm.models.records.camera import GivenCameras, Intrinsics, ShotCamera
from humanmm.models.records.shots import ShotList
from humanmm.models.records.video import VideoFacts
from humanmm.storage.readers.given.cameras import read_cameras
from humanmm.storage.run_folder.camera_folder import write_camera_folder
from humanmm.storage.run_folder.exporters import export
from humanmm.storage.run_folder.exporters.cameras.colmap import colmap_files
from humanmm.storage.run_folder.exporters.cameras.tum import tum_files

N = 8
FACTS = VideoFacts(1280, 720, np.arange(N) / 25, np.ones(N, bool), 0, "h264", "mp4")
R = Rotation.from_euler("yx", np.c_[np.linspace(0, 40, N), np.linspace(5, 0, N)], degrees=True).as_matrix()
T = np.stack([np.linspace(0, 2, N), np.zeros(N), np.linspace(1, 3, N)], axis=1)


def _tum(path: Path, moments: np.ndarray) -> Path:
    rows = np.column_stack([moments, T, Rotation.from_matrix(R).as_quat()])
    path.write_text("# timestamp tx ty tz qx qy qz qw\n" + "\n".join(" ".join(f"{v:.9f}" for v in r) for r in rows))
    return path


def _colmap(
    folder: Path, *, model: str = "PINHOLE", scale: float = 0.5, first: int = 0, step: int = 1, binary: bool = False
) -> Path:
    """By pycolmap: pictures at half the video's size."""
    model_of = pycolmap.Reconstruction()
    width, height = int(1280 * scale), int(720 * scale)
    parameters = {"PINHOLE": [450.0, 450.0, 320.0, 180.0], "SIMPLE_RADIAL": [450.0, 320.0, 180.0, 0.1]}[model]
    camera = pycolmap.Camera(model=model, width=width, height=height, params=parameters, camera_id=1)
    model_of.add_camera_with_trivial_rig(camera)
    for k in range(0, N, step):
        image = pycolmap.Image(name=f"frames/{k + first:05d}.png", camera_id=1, image_id=k + 1)
        image.points2D = pycolmap.Point2DList([pycolmap.Point2D(np.array([1.0, 2.0]))] if k % 2 else [])
        pose = pycolmap.Rigid3d(pycolmap.Rotation3d(R[k].T), -R[k].T @ T[k])
        model_of.add_image_with_trivial_frame(image, pose)
    folder.mkdir()
    (model_of.write_binary if binary else model_of.write_text)(str(folder))
    return folder


def _read(path: Path, facts: VideoFacts = FACTS) -> GivenCameras:
    return read_cameras(GivenFile.model_validate(path), facts)


def _check(found: GivenCameras, frames: list[int]) -> None:
    assert found.frame.tolist() == frames
    np.testing.assert_allclose(found.R_given_cam, R[frames], atol=1e-7)
    np.testing.assert_allclose(found.t_given_cam, T[frames], atol=1e-7)


@pytest.mark.parametrize("moments", [np.arange(N) / 25, np.arange(N) / 25 + 0.004, np.arange(float(N))])
def test_a_tum_trajectory_in_seconds_or_frames(tmp_path: Path, moments: np.ndarray) -> None:
    found = _read(_tum(tmp_path / "way.txt", moments))
    _check(found, list(range(N)))
    assert np.isnan(found.focal_px).all()


def test_of_a_tum_trajectory_times_between_frames_are_left_out(tmp_path: Path) -> None:
    facts = VideoFacts(1280, 720, np.array([0.0, 0.04, 0.08, 0.2, 0.24, 0.28]), np.ones(6, bool), 0, "h264", "mp4")
    found = _read(_tum(tmp_path / "way.tum", np.arange(N) / 25), facts)
    assert found.frame.tolist() == [0, 1, 2, 3, 4, 5]
    np.testing.assert_allclose(found.t_given_cam, T[[0, 1, 2, 5, 6, 7]], atol=1e-7)


def test_several_tum_trajectories_are_one_a_shot(tmp_path: Path) -> None:
    rows = _tum(tmp_path / "whole.txt", np.arange(N) / 25).read_text().splitlines()
    (tmp_path / "shots").mkdir()
    (tmp_path / "shots" / "a.txt").write_text("\n".join(rows[1:5]))
    (tmp_path / "shots" / "b.txt").write_text("\n".join(rows[5:]))
    _check(_read(tmp_path / "shots"), list(range(N)))


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("first", [0, 1])
def test_a_colmap_model_that_pycolmap_wrote(tmp_path: Path, first: int, binary: bool) -> None:
    found = _read(_colmap(tmp_path / "sparse", first=first, binary=binary))
    _check(found, list(range(N)))
    np.testing.assert_allclose(found.focal_px, 900.0)
    assert not found.warnings


def test_a_colmap_model_that_begins_at_1_and_lacks_the_last_picture_may_count_from_1(tmp_path: Path) -> None:
    folder = _colmap(tmp_path / "sparse", first=1)
    lines = (folder / "images.txt").read_text().splitlines()
    last = next(k for k, line in enumerate(lines) if line.endswith(f"frames/{N:05d}.png"))
    (folder / "images.txt").write_text("\n".join(lines[:last] + lines[last + 2 :]) + "\n")
    found = _read(folder)
    assert found.frame.tolist() == list(range(1, N))
    (warning,) = found.warnings
    assert "given cameras begin at frame 1, and are taken as counted from 0" in warning


WIDE = replace(FACTS, width=1280, coded_size=(880, 720), sample_aspect_ratio=(16, 11))


def test_pictures_of_stored_pixels_are_known_by_their_proportion(tmp_path: Path) -> None:
    folder = _colmap(tmp_path / "sparse")
    square = _read(folder, WIDE)
    np.testing.assert_allclose(square.focal_px, 900.0)
    lens = (folder / "cameras.txt").read_text()
    (folder / "cameras.txt").write_text(lens.replace("640 360 450 450 320 180", "880 720 618.75 900 440 360"))
    stored = _read(folder, WIDE)
    _check(stored, list(range(N)))
    np.testing.assert_allclose(stored.focal_px, 900.0)
    assert not square.warnings and not stored.warnings


def test_one_focal_length_for_pixels_that_are_not_square_is_a_warning(tmp_path: Path) -> None:
    folder = _colmap(tmp_path / "sparse", model="SIMPLE_RADIAL")
    lens = (folder / "cameras.txt").read_text()
    (folder / "cameras.txt").write_text(lens.replace("640 360 450 320 180", "880 720 700 440 360"))
    assert "one focal length for pixels that are not square" in _read(folder, WIDE).warnings[0]


def test_our_own_cameras_come_back_for_a_video_whose_pixels_are_not_square(tmp_path: Path) -> None:
    own = recording()
    coded = own.width * 11 // 16, own.height
    facts = VideoFacts(
        own.width, own.height, own.time_s, np.ones(40, bool), 0, "h264", "mp4", coded_size=coded,
        sample_aspect_ratio=(16, 11),
    )  # fmt: skip
    for name, write in colmap_files(excerpt(own, Wishes(), up="z", unit="m")).items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        write(tmp_path / name)
    np.testing.assert_allclose(_read(tmp_path / "colmap", facts).focal_px, own.K[:, 0, 0], rtol=1e-6)


def test_a_lens_that_distorts_is_reported_and_frames_may_be_missing(tmp_path: Path) -> None:
    found = _read(_colmap(tmp_path / "sparse", model="SIMPLE_RADIAL", step=3))
    _check(found, [0, 3, 6])
    assert found.warnings == ("the given lens distorts; it is taken for one that does not",)


def test_our_own_exports_come_back(tmp_path: Path) -> None:
    own = recording()
    taken = excerpt(own, Wishes(), up="z", unit="m")
    facts = VideoFacts(own.width, own.height, own.time_s, np.ones(40, bool), 0, "h264", "mp4")
    (tmp_path / "colmap").mkdir()
    for name, write in {**colmap_files(taken), **tum_files(taken)}.items():
        write(tmp_path / name)
    found = _read(tmp_path / "colmap", facts)
    np.testing.assert_allclose(found.R_given_cam, own.R_world_cam, atol=1e-5)
    np.testing.assert_allclose(found.t_given_cam, own.t_world_cam, atol=1e-5)
    np.testing.assert_allclose(found.focal_px, own.K[:, 0, 0], rtol=1e-6)
    first = _read(tmp_path / "shot_000.tum", facts)
    assert first.frame.tolist() == list(range(25))
    np.testing.assert_allclose(first.t_given_cam, own.t_world_cam[:25], atol=1e-5)


def test_the_folder_of_our_own_trajectories_comes_back_whatever_else_lies_in_it(tmp_path: Path) -> None:
    own = recording()
    facts = VideoFacts(own.width, own.height, own.time_s, np.ones(40, bool), 0, "h264", "mp4")
    export(own, tmp_path, "tum")
    export(own, tmp_path, "amass")
    (tmp_path / "notes.txt").write_text("the cameras of the film\n")
    found = _read(tmp_path, facts)
    np.testing.assert_allclose(found.R_given_cam, own.R_world_cam, atol=1e-5)
    np.testing.assert_allclose(found.t_given_cam, own.t_world_cam, atol=1e-5)


def test_the_folder_of_humanmm_camera_comes_back(tmp_path: Path) -> None:
    own = recording()
    facts = VideoFacts(own.width, own.height, own.time_s, np.ones(40, bool), 0, "h264", "mp4")
    cameras = [
        ShotCamera(
            start, end, own.R_world_cam[start:end], own.t_world_cam[start:end], own.K[start:end], "tracked",
            metric=False, reprojection_px=0.5,
        )
        for start, end in pairwise([0, *own.cut_frames, own.num_frames])
    ]  # fmt: skip
    lens = Intrinsics(1100.0, own.width, own.height, "estimated", 0.1)
    write_camera_folder(tmp_path / "cams", facts, ShotList(40, (), ()), lens, cameras, force=False)
    found = _read(tmp_path / "cams", facts)
    assert found.frame.tolist() == list(range(40))
    np.testing.assert_allclose(found.t_given_cam, own.t_world_cam, atol=1e-5)


@pytest.mark.parametrize("name", ["cameras.json", "person_00.npz", "model.bin"])
def test_a_file_that_is_no_camera_is_reported_with_what_to_give(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("{}")
    for path in (tmp_path, tmp_path / name):
        with pytest.raises(InputError) as caught:
            _read(path)
        words = str(caught.value)
        assert name in words and "give a .tum or .txt file" in words and "\n" not in words


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0 1 2 3\n", "a line of a TUM trajectory reads '0 1 2 3'; expected 8 numbers"),
        ("# nothing\n", "holds no camera"),
        ("0 0 0 0 0 0 0 2\n", "a quaternion of length 2"),
        ("1700000000.5 0 0 0 0 0 0 1\n", "its times go to 1.7e+09 s, the video ends at 0.280 s"),
        ("0 0 0 nan 0 0 0 1\n", "expected 8 numbers"),
    ],
)
def test_what_is_wrong_with_a_trajectory_is_reported(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "way.tum").write_text(text)
    with pytest.raises(InputError) as caught:
        _read(tmp_path / "way.tum")
    assert message in str(caught.value) and str(tmp_path) in str(caught.value)


@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        ("cameras.txt", "PINHOLE", "FISHEYE", "expected one of SIMPLE_PINHOLE"),
        ("cameras.txt", "640 360", "640 640", "has pictures of 640×640, the video of 1280×720"),
        ("images.txt", "00007.png", "00700.png", "are of frames 0 to 700, the video has 8"),
        ("images.txt", "00007.png", "last.png", "no number in the name 'frames/last.png'"),
        (
            "images.txt",
            " 1 frames/00007",
            " 4 frames/00007",
            "image 'frames/00007.png' is of camera 4, which the model does not",
        ),
    ],
)
def test_what_is_wrong_with_a_model_is_reported(tmp_path: Path, name: str, old: str, new: str, message: str) -> None:
    path = _colmap(tmp_path / "sparse") / name
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(InputError) as caught:
        _read(tmp_path / "sparse")
    assert message in str(caught.value)
