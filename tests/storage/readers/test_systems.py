"""Results of other systems, written here with the keys and types that their code writes, come out as one motion."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch

from humanmm.errors import InputError
from humanmm.models.body.body24 import JOINT_NAMES
from humanmm.models.evaluation.pose import pa_mpjpe_mm
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.records.sequence import MotionSequence
from humanmm.storage.readers.systems import find_result, read_result

Dump = Callable[[object, Path], None]

N = 12
POSE = np.random.default_rng(0).normal(0, 0.2, (N, 23, 3))
POSE[:, 21:] = 0  # GVHMR and SLAHMR end at the wrists
HEADING = np.stack([np.zeros(N), np.linspace(0, 1, N), np.zeros(N)], axis=1)  # about y, upright
WAY = np.stack([np.linspace(0, 2, N), np.full(N, 1.1), np.zeros(N)], axis=1)
R_CAMERA = np.diag([1.0, -1.0, -1.0])  # y-up axes to a camera's


def _gvhmr(path: Path) -> Path:
    params = {
        "global_orient": HEADING,
        "body_pose": POSE[:, :21].reshape(N, 63),
        "transl": WAY,
        "betas": np.zeros((N, 10)),
    }
    tree = {"smpl_params_global": {name: torch.from_numpy(value).float() for name, value in params.items()}}
    torch.save({**tree, "K_fullimg": torch.eye(3).repeat(N, 1, 1)}, path)
    return path


def _wham(path: Path, dump: Dump) -> Path:
    pose = np.concatenate([HEADING, POSE.reshape(N, 69)], axis=1).astype(np.float32)
    track = {"pose_world": pose, "trans_world": WAY.astype(np.float32), "frame_ids": np.arange(N), "pose": pose}
    short = {name: value[:3] for name, value in track.items()}
    dump({0: short, 1: track}, path)
    return path


def _slahmr(path: Path) -> Path:
    R = R_CAMERA @ rotvec_to_rotmat(HEADING)
    np.savez(
        path, root_orient=rotmat_to_rotvec(R)[None], pose_body=POSE[None, :, :21].reshape(1, N, 63),
        trans=(WAY @ R_CAMERA.T)[None], floor_plane=np.array([[0.0, -0.5, 0.0]]), betas=np.zeros((1, 16)),
    )  # fmt: skip
    return path


def _tram(path: Path) -> Path:
    turn = rotvec_to_rotmat(np.stack([np.zeros(N), np.linspace(0, 0.5, N), np.zeros(N)], axis=1))
    root = np.swapaxes(turn, -1, -2) @ R_CAMERA @ rotvec_to_rotmat(HEADING)
    rotmat = np.concatenate([root[:, None], rotvec_to_rotmat(POSE)], axis=1)
    np.savez(
        path, pred_rotmat=rotmat, pred_trans=(WAY @ R_CAMERA.T)[:, None] @ turn, frame=np.arange(N), pred_cam_R=turn,
        pred_cam_T=np.zeros((N, 3)),
    )  # fmt: skip
    return path


WRITERS = {"gvhmr.pt": _gvhmr, "slahmr.npz": _slahmr, "tram.npz": _tram}


def _read(path: Path) -> MotionSequence:
    return read_result(path, num_frames=N, fps=30.0)


@pytest.mark.parametrize("name", [*WRITERS, "wham.pkl"])
def test_every_system_gives_the_same_person_upright(tmp_path: Path, name: str, dump_like_joblib: Dump) -> None:
    path = _wham(tmp_path / name, dump_like_joblib) if name == "wham.pkl" else WRITERS[name](tmp_path / name)
    sequence, reference = _read(path), _read(_gvhmr(tmp_path / "reference.pt"))
    person, expected = sequence.people[0], reference.people[0]
    assert sequence.joint_names == JOINT_NAMES
    assert person.R_world_root is not None
    assert np.array_equal(person.frame, np.arange(N))
    # The body's up is the world's up, and the path runs on the floor.
    assert np.allclose(person.R_world_root[:, 2, 1], 1, atol=1e-6)
    assert np.ptp(person.joints[:, 0, 2]) < 0.05  # TRAM's camera turns about an axis beside the pelvis
    assert abs(np.linalg.norm(person.joints[-1, 0] - person.joints[0, 0]) - 2) < 0.06
    assert pa_mpjpe_mm(person.joints, expected.joints) < 1e-3


def test_the_longest_track_is_taken_and_the_others_are_reported(tmp_path: Path, dump_like_joblib: Dump) -> None:
    sequence = _read(_wham(tmp_path / "wham.pkl", dump_like_joblib))
    assert len(sequence.people[0].frame) == N
    assert sequence.notes == ("2 tracks were found; one is compared.",)


def test_a_result_of_another_video_or_without_its_keys_is_one_plain_error(
    tmp_path: Path, dump_like_joblib: Dump
) -> None:
    with pytest.raises(InputError, match="is it of another video"):
        read_result(_gvhmr(tmp_path / "a.pt"), num_frames=N - 5, fps=30.0)
    torch.save({"pred": torch.zeros(3)}, tmp_path / "b.pt")
    with pytest.raises(InputError, match="lacks smpl_params_global"):
        _read(tmp_path / "b.pt")
    (tmp_path / "c.pt").write_bytes(b"no file of torch")
    with pytest.raises(InputError, match="cannot be read"):
        _read(tmp_path / "c.pt")
    dump_like_joblib({"a": np.zeros(3)}, tmp_path / "d.pkl")
    with pytest.raises(InputError, match="no track with pose_world"):
        _read(tmp_path / "d.pkl")


NAN, EYES = np.full((N, 3), np.nan), np.tile(np.eye(3), (N, 24, 1, 1))


@pytest.mark.parametrize(
    ("key", "value", "sentence"),
    [
        ("transl", torch.zeros(N, 3, device="meta"), "transl is a tensor of another kind .meta"),
        ("transl", torch.zeros(N, 3).to_sparse(), "transl is a tensor of another kind .cpu torch.sparse"),
        ("transl", torch.zeros(1, 3).expand(10**9, 3), "transl declares 3,000,000,000 numbers"),
        ("transl", torch.zeros(5, 3), "transl has shape 5×3; expected 12×3"),
        ("transl", torch.zeros(N, 3, dtype=torch.complex64), "transl has type complex64; expected numbers"),
        ("transl", "hello", "transl has a single value; expected 12×3"),
        ("global_orient", torch.from_numpy(NAN), "global_orient holds numbers that are not finite, the first in row 0"),
        ("body_pose", torch.zeros(N, 60), "body_pose has shape 12×60; expected 12×63"),
    ],
)
def test_what_is_wrong_with_gvhmrs_tensors_is_reported_by_key(
    tmp_path: Path, key: str, value: object, sentence: str
) -> None:
    tree = torch.load(_gvhmr(tmp_path / "a.pt"))
    tree["smpl_params_global"][key] = value
    torch.save(tree, tmp_path / "a.pt")
    with pytest.raises(InputError, match=f"a.pt: {sentence}"):
        _read(tmp_path / "a.pt")


@pytest.mark.parametrize(
    ("key", "value", "sentence"),
    [
        ("frame_ids", None, "frame_ids is missing"),
        ("frame_ids", np.arange(N) - 3, "frame_ids holds the negative frame -3"),
        ("frame_ids", np.zeros(N, int), "frame_ids does not rise strictly: 0 follows 0"),
        ("frame_ids", np.arange(N) + 0.5, "frame_ids holds 0.5; expected whole numbers"),
        ("frame_ids", 3, "frame_ids has a single value; expected 12"),
        ("trans_world", np.zeros((5, 3)), "trans_world has shape 5×3; expected 12×3"),
        ("pose_world", np.full((N, 72), np.nan), "pose_world holds numbers that are not finite"),
    ],
)
def test_what_is_wrong_with_whams_arrays_is_reported_by_key(
    tmp_path: Path, dump_like_joblib: Dump, key: str, value: object, sentence: str
) -> None:
    track = {"pose_world": np.zeros((N, 72)), "trans_world": np.zeros((N, 3)), "frame_ids": np.arange(N), key: value}
    dump_like_joblib({0: {name: value for name, value in track.items() if value is not None}}, tmp_path / "a.pkl")
    with pytest.raises(InputError, match=f"a.pkl: {sentence}"):
        _read(tmp_path / "a.pkl")


@pytest.mark.parametrize(
    ("write", "key", "value", "sentence"),
    [
        (_slahmr, "trans", None, "trans is missing"),
        (_slahmr, "trans", np.zeros((1, 3, 3)), "trans has shape 3×3; expected 12×3"),
        (_slahmr, "trans", np.full((1, N, 3), "x"), "trans has type <U1; expected numbers"),
        (_slahmr, "root_orient", NAN[None], "root_orient holds numbers that are not finite"),
        (_slahmr, "root_orient", np.zeros((0, N, 3)), "root_orient has shape 0×12×3; expected N×3"),
        (_slahmr, "floor_plane", np.float64(1), "floor_plane has shape .1, 1.; expected at least one row"),
        (_tram, "frame", np.arange(N) + 99_988, "frame goes to frame 99999; the frames end at 11"),
        (_tram, "frame", np.arange(N) - 5, "frame holds the negative frame -5"),
        (_tram, "pred_rotmat", EYES * 0, "pred_rotmat holds 288 matrices that are no rotations, the first in row 0"),
        (_tram, "pred_rotmat", EYES * np.nan, "pred_rotmat holds numbers that are not finite"),
        (_tram, "pred_cam_R", None, "pred_cam_R is missing"),
        (_tram, "pred_cam_T", np.zeros((3, 3)), "pred_cam_T has shape 3×3; expected 12×3"),
    ],
)
def test_what_is_wrong_with_the_arrays_of_an_npz_is_reported_by_key(
    tmp_path: Path, write: Callable[[Path], Path], key: str, value: np.ndarray | None, sentence: str
) -> None:
    with np.load(write(tmp_path / "a.npz")) as file:
        arrays = {**file, key: value}
    np.savez(tmp_path / "a.npz", **{name: array for name, array in arrays.items() if array is not None})
    with pytest.raises(InputError, match=f"a.npz: {sentence}"):
        _read(tmp_path / "a.npz")


@pytest.mark.parametrize("name", ["gvhmr.pt", "slahmr.npz", "wham.pkl"])
@pytest.mark.parametrize("damage", ["cut off", "empty", "flipped", "another file"])
def test_a_damaged_result_is_reported_without_the_words_of_a_library(
    tmp_path: Path, dump_like_joblib: Dump, name: str, damage: str
) -> None:
    path = _wham(tmp_path / name, dump_like_joblib) if name == "wham.pkl" else WRITERS[name](tmp_path / name)
    data = path.read_bytes()
    flipped = bytes(byte ^ 0xFF if 100 <= at < 130 or at > len(data) - 70 else byte for at, byte in enumerate(data))
    path.write_bytes({"cut off": data[: len(data) // 2], "empty": b"", "flipped": flipped}.get(damage, b"a" * 5000))
    with pytest.raises(InputError, match=r"damaged") as raised:
        _read(path)
    assert str(raised.value).startswith(str(path))
    assert not any(word in str(raised.value) for word in ("miniz", "codec", "Memo", "magic", "CRC", "central"))


def test_a_torch_file_that_holds_code_is_refused(tmp_path: Path) -> None:
    class Trap:
        def __reduce__(self) -> tuple[object, tuple[str]]:
            return Path.touch, (tmp_path / "owned",)  # type: ignore[return-value]

    torch.save({"smpl_params_global": Trap()}, tmp_path / "a.pt")
    with pytest.raises(InputError, match="cannot be read"):
        _read(tmp_path / "a.pt")
    assert not (tmp_path / "owned").exists()


def test_results_are_found_by_the_videos_name_or_in_its_folder(tmp_path: Path) -> None:
    (tmp_path / "walk.pkl").touch()
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "hmr4d_results.pt").touch()
    (tmp_path / "run" / "preprocess.pt").touch()
    assert find_result(tmp_path, "walk") == tmp_path / "walk.pkl"
    assert find_result(tmp_path, "run") == tmp_path / "run" / "hmr4d_results.pt"
    assert find_result(tmp_path, "sit") is None
