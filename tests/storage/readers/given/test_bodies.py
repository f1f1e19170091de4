"""Results of other systems, written here in the layouts that they publish, come out as the bodies that they hold."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from humanmm.config import GivenFile
from humanmm.errors import InputError
from humanmm.models.body.body24 import load_body
from humanmm.models.body.smpl_joints import SMPL_REST_PELVIS, SMPLX_REST_PELVIS
from humanmm.models.geometry.projection import project
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.perception.tracking.given_bodies import GivenBody, smpl_body
from humanmm.models.records.landmarks import INDEX
from humanmm.models.records.video import PictureSizes
from humanmm.storage.readers.given.bodies import MHR70, SOMA77, read_bodies

Dump = Callable[[object, Path], None]

N, SIZE, FOCAL = 12, (1280, 720), 900.0
POSE = np.random.default_rng(0).normal(0, 0.2, (N, 23, 3))
POSE[:, 21:] = 0
ROOT = rotvec_to_rotmat(np.stack([np.full(N, np.pi), np.linspace(0, 1, N), np.zeros(N)], axis=1))
PELVIS = np.stack([np.linspace(-1, 1, N), np.full(N, 0.1), np.full(N, 5.0)], axis=1)
K = np.tile(np.array([[FOCAL, 0, 640], [0, FOCAL, 360], [0, 0, 1.0]]), (N, 1, 1))
BODY = smpl_body(np.arange(N), ROOT, POSE, PELVIS, K)


def _parameters(*, rest: np.ndarray = SMPLX_REST_PELVIS, frames: slice = slice(None)) -> dict[str, torch.Tensor]:
    arrays = {
        "global_orient": rotmat_to_rotvec(ROOT),
        "body_pose": POSE[:, :21].reshape(N, 63),
        "transl": PELVIS - rest,
        "betas": np.zeros((N, 10)),
    }
    return {name: torch.from_numpy(value[frames]).float() for name, value in arrays.items()}


def _gvhmr(path: Path, *, key: str = "smpl_params_incam", frames: slice = slice(None)) -> None:
    torch.save({key: _parameters(frames=frames), "K_fullimg": torch.from_numpy(K[frames]).float()}, path)


def _gem(path: Path) -> None:
    _gvhmr(path, key="body_params_incam")


def _tram(path: Path) -> None:
    rotmat = np.concatenate([ROOT[:, None], rotvec_to_rotmat(POSE)], axis=1)
    trans = (PELVIS - SMPL_REST_PELVIS)[:, None]
    centre = np.array([640.0, 360.0])
    np.savez(path, pred_rotmat=rotmat, pred_trans=trans, frame=np.arange(N), img_focal=FOCAL, img_center=centre)


def _slahmr(path: Path) -> None:
    """In a world of its own."""
    R_cam_world = rotvec_to_rotmat(np.stack([np.zeros(N), np.linspace(0, 0.5, N), np.zeros(N)], axis=1))
    t_cam_world = np.stack([np.linspace(0, 1, N), np.zeros(N), np.zeros(N)], axis=1)
    pelvis = np.einsum("nji,nj->ni", R_cam_world, PELVIS - t_cam_world)
    root = np.swapaxes(R_cam_world, -1, -2) @ ROOT
    np.savez(
        path, root_orient=rotmat_to_rotvec(root)[None], pose_body=POSE[None, :, :21].reshape(1, N, 63),
        trans=(pelvis - SMPL_REST_PELVIS)[None], cam_R=R_cam_world[None], cam_t=t_cam_world[None],
        intrins=np.array([FOCAL, FOCAL, 640, 360]), betas=np.zeros((1, 16)),
    )  # fmt: skip


WRITERS = {"gvhmr.pt": _gvhmr, "gem.pt": _gem, "tram.npz": _tram, "slahmr.npz": _slahmr}


def _wham(path: Path, dump: Dump) -> None:
    pose = np.concatenate([rotmat_to_rotvec(ROOT), POSE.reshape(N, 69)], axis=1).astype(np.float32)
    trans = (PELVIS - SMPL_REST_PELVIS).astype(np.float32)
    dump({0: {"pose": pose, "trans": trans, "frame_ids": np.arange(N), "betas": np.zeros((N, 10))}}, path)


def _prompthmr(path: Path, dump: Dump) -> None:
    pose = np.zeros((N, 165), np.float32)
    pose[:, :66] = np.concatenate([rotmat_to_rotvec(ROOT)[:, None], POSE[:, :21]], axis=1).reshape(N, 66)
    incam = {"pose": pose, "shape": np.zeros((N, 10)), "trans": (PELVIS - SMPLX_REST_PELVIS).astype(np.float32)}
    camera = {"img_focal": FOCAL / 2, "img_center": np.array([320.0, 180.0])}  # of pictures of half the size
    dump({"camera": camera, "people": {1: {"frames": np.arange(N), "smplx_cam": incam}}}, path)


def _read(path: Path, num_frames: int = N) -> tuple[GivenBody, ...]:
    return read_bodies(GivenFile.model_validate(path), num_frames, PictureSizes(SIZE, SIZE))


@pytest.mark.parametrize("name", [*WRITERS, "wham.pkl", "prompthmr.pkl"])
def test_every_system_gives_the_same_body(tmp_path: Path, name: str, dump_like_joblib: Dump) -> None:
    if name in WRITERS:
        WRITERS[name](tmp_path / name)
    else:
        {"wham.pkl": _wham, "prompthmr.pkl": _prompthmr}[name](tmp_path / name, dump_like_joblib)
    (body,) = _read(tmp_path / name)
    assert np.array_equal(body.frame, np.arange(N)) and body.R_local is not None and BODY.R_local is not None
    np.testing.assert_allclose(body.landmarks_cam, BODY.landmarks_cam, atol=1e-5)
    np.testing.assert_allclose(body.R_local, BODY.R_local, atol=1e-5)
    focal = float(np.hypot(*SIZE)) if name == "wham.pkl" else FOCAL
    np.testing.assert_allclose(body.K[:, 0, 0], focal)


WIDE = PictureSizes((1920, 720), SIZE)
"""Of a video whose stored pixels are half as wide again as high."""


@pytest.mark.parametrize("name", [*WRITERS, "wham.pkl", "prompthmr.pkl", "mhr.npz"])
def test_what_a_system_saw_in_stored_pixels_lies_there_in_square_ones(
    tmp_path: Path, name: str, dump_like_joblib: Dump
) -> None:
    if name in WRITERS:
        WRITERS[name](tmp_path / name)
    elif name == "mhr.npz":
        _sam_3d_body(tmp_path / name)
    else:
        {"wham.pkl": _wham, "prompthmr.pkl": _prompthmr}[name](tmp_path / name, dump_like_joblib)
    seen = _read(tmp_path / name)[0]
    body = read_bodies(GivenFile.model_validate(tmp_path / name), N, WIDE)[0]
    np.testing.assert_allclose(body.landmarks_cam, seen.landmarks_cam)
    pixels, expected = (project(one.landmarks_cam, one.K, near_m=0.1) for one in (body, seen))
    np.testing.assert_allclose(pixels, expected * [1.5, 1.0])


def test_a_camera_of_square_pixels_is_known_by_the_middle_of_its_picture(tmp_path: Path) -> None:
    _gvhmr(tmp_path / "gvhmr.pt")
    given = GivenFile.model_validate(tmp_path / "gvhmr.pt")
    (body,) = read_bodies(given, N, PictureSizes(SIZE, (880, 720)))
    np.testing.assert_allclose(body.K, K, rtol=1e-6)


def _sam_3d_body(path: Path, **other: Any) -> None:
    points = np.repeat(PELVIS[:, None], 70, axis=1)
    for name, number in MHR70.items():
        points[:, number] = BODY.landmarks_cam[:, INDEX[name]]
    points = np.repeat(points, 2, axis=0)
    away = np.array([0.2, 0.0, 1.0])
    pixels = points @ K[0].T
    pixels = pixels[..., :2] / pixels[..., 2:]
    rows = {
        "pred_keypoints_3d": points - away, "pred_cam_t": np.tile(away, (2 * N, 1)), "pred_keypoints_2d": pixels,
        "focal_length": np.full(2 * N, FOCAL), "frame": np.repeat(np.arange(N), 2), "person": np.tile([0, 1], N),
    }  # fmt: skip
    np.savez(path, **{**rows, **other})


def test_sam_3d_body_gives_places_and_two_people(tmp_path: Path) -> None:
    _sam_3d_body(tmp_path / "mhr.npz")
    bodies = _read(tmp_path / "mhr.npz")
    assert [len(body.frame) for body in bodies] == [N, N]
    assert all(body.R_local is None and body.known.sum() == len(MHR70) for body in bodies)
    with np.load(tmp_path / "mhr.npz") as file:
        expected = (file["pred_keypoints_3d"] + file["pred_cam_t"][:, None])[::2, MHR70["left_knee"]]
    np.testing.assert_allclose(bodies[0].landmarks_cam[:, INDEX["left_knee"]], expected)


def _gem_x(path: Path, *, root: bool = False, unit: float = 1.0, joints: int = 77) -> None:
    points = np.repeat(PELVIS[:, None], joints, axis=1)
    for name, number in SOMA77.items():
        if number < joints:
            points[:, number] = BODY.landmarks_cam[:, INDEX[name]]
    if root:
        points = np.concatenate([np.zeros((N, 1, 3)), points], axis=1)
    np.savez(path, soma_joints=unit * points, K_fullimg=K)


@pytest.mark.parametrize("root", [False, True])
def test_gem_x_gives_the_places_of_somas_joints(tmp_path: Path, root: bool) -> None:
    _gem_x(tmp_path / "soma.npz", root=root)
    (body,) = _read(tmp_path / "soma.npz")
    assert body.R_local is None and body.known.sum() == len(SOMA77) and np.array_equal(body.frame, np.arange(N))
    np.testing.assert_allclose(body.landmarks_cam[:, body.known], BODY.landmarks_cam[:, body.known])


def test_clips_begin_at_the_frame_in_their_names(tmp_path: Path) -> None:
    _gvhmr(tmp_path / "walk@0000.pt", frames=slice(0, 7))
    _gvhmr(tmp_path / "walk@0007.pt", frames=slice(7, N))
    first, second = _read(tmp_path)
    assert np.array_equal(np.concatenate([first.frame, second.frame]), np.arange(N))
    np.testing.assert_allclose(second.landmarks_cam, BODY.landmarks_cam[7:], atol=1e-5)


def test_of_a_folder_other_files_are_left_alone(tmp_path: Path) -> None:
    _gvhmr(tmp_path / "person_00.pt")
    (tmp_path / "exports.json").write_text("{}")
    assert len(_read(tmp_path)) == 1
    (tmp_path / "person_00.pt").unlink()
    with pytest.raises(InputError, match=r"no folder of some"):
        _read(tmp_path)


def test_frames_a_little_beyond_the_end_are_cut_off(tmp_path: Path) -> None:
    _gvhmr(tmp_path / "a.pt")
    (body,) = _read(tmp_path / "a.pt", N - 1)
    assert len(body.frame) == len(body.landmarks_cam) == len(body.K) == N - 1


def test_what_is_wrong_is_told_with_key_and_shape(tmp_path: Path, dump_like_joblib: Dump) -> None:
    def told(path: Path, num_frames: int = N) -> str:
        with pytest.raises(InputError) as caught:
            _read(path, num_frames)
        assert str(tmp_path) in str(caught.value)
        return str(caught.value)

    _gvhmr(tmp_path / "a.pt")
    assert "frames 0 to 11, the video has 5" in told(tmp_path / "a.pt", 5)
    assert "has 12 frames and does not say which, the video has 30" in told(tmp_path / "a.pt", 30)
    torch.save({"smpl_params_global": {}}, tmp_path / "b.pt")
    assert "lacks smpl_params_incam" in told(tmp_path / "b.pt")
    soma = {**_parameters(), "body_pose": torch.zeros(N, 228)}
    torch.save({"body_params_incam": soma, "K_fullimg": torch.from_numpy(K)}, tmp_path / "c.pt")
    assert "body_pose has 228 columns; expected 63, those of SMPL's body: it is GEM-X's SOMA" in told(tmp_path / "c.pt")
    torch.save({"smpl_params_incam": _parameters(), "K_fullimg": torch.from_numpy(K[:3])}, tmp_path / "d.pt")
    assert "K_fullimg has shape 3×3×3; expected 12×3×3" in told(tmp_path / "d.pt")
    other = torch.from_numpy(K * np.array([1, 2, 1])[:, None])
    torch.save({"smpl_params_incam": _parameters(), "K_fullimg": other}, tmp_path / "e.pt")
    assert "middle of the picture at (640, 720), the video at (640, 360)" in told(tmp_path / "e.pt")
    dump_like_joblib({"a": np.zeros(3)}, tmp_path / "f.pkl")
    assert "neither people (PromptHMR) nor tracks with pose (WHAM)" in told(tmp_path / "f.pkl")
    np.savez(tmp_path / "g.npz", joints=np.zeros(3))
    assert "holds joints; expected one of pred_rotmat" in told(tmp_path / "g.npz")
    _sam_3d_body(tmp_path / "h.npz", focal_length=np.full(2 * N, 2 * FOCAL))
    assert "pixels beside pred_keypoints_2d" in told(tmp_path / "h.npz")
    _gem_x(tmp_path / "k.npz", unit=100.0)
    assert "expected metres, and the joints in SOMA's order" in told(tmp_path / "k.npz")
    millimetres = {**_parameters(), "transl": torch.from_numpy(1000 * (PELVIS - SMPLX_REST_PELVIS))}
    torch.save({"smpl_params_incam": millimetres, "K_fullimg": torch.from_numpy(K)}, tmp_path / "m.pt")
    assert "person 5,039 m from the camera; metres expected" in told(tmp_path / "m.pt")
    _gem_x(tmp_path / "l.npz", joints=70)
    assert "soma_joints has 70 joints; expected SOMA's 77" in told(tmp_path / "l.npz")
    (tmp_path / "i.pt").write_bytes(b"nothing of torch")
    assert "cannot be read" in told(tmp_path / "i.pt")
    (tmp_path / "j.json").write_text("[]")
    assert "it is no .pt, .pkl or .npz, and no folder of some" in told(tmp_path / "j.json")


def _with_height(path: Path, height_m: float, dump: Dump) -> None:
    """Write a height into a file of one body."""
    if path.suffix == ".pt":
        torch.save({**torch.load(path), "height_m": torch.tensor(height_m)}, path)
    elif path.suffix == ".npz":
        arrays = {name: value for name, value in np.load(path).items() if name != "height_m"}
        many = "pose_body" in arrays
        np.savez(path, **arrays, height_m=np.full(1, height_m) if many else np.float64(height_m))
    else:
        pose = np.concatenate([rotmat_to_rotvec(ROOT), POSE.reshape(N, 69)], axis=1)
        dump({0: {"pose": pose, "trans": PELVIS, "frame_ids": np.arange(N), "height_m": height_m}}, path)


@pytest.mark.parametrize("name", ["gvhmr.pt", "tram.npz", "slahmr.npz", "wham.pkl"])
def test_a_body_is_as_large_as_the_height_beside_it_says(tmp_path: Path, name: str, dump_like_joblib: Dump) -> None:
    def size(body: GivenBody) -> float:
        return float(np.linalg.norm(body.landmarks_cam[0] - body.landmarks_cam[0].mean(axis=0)))

    path = tmp_path / name
    if name in WRITERS:
        WRITERS[name](path)
    _with_height(path, 1.9, dump_like_joblib)
    (body,) = _read(path)
    average_m = load_body().standing_height(np.zeros(10))
    assert size(body) / size(BODY) == pytest.approx(1.9 / average_m, rel=0.02)
    _with_height(path, 190.0, dump_like_joblib)
    with pytest.raises(InputError, match=r"height_m is 190; expected metres, 0\.5 to 2\.5"):
        _read(path)
