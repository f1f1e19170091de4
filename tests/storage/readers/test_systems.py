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


def test_the_longest_track_is_taken_and_the_others_are_told(tmp_path: Path, dump_like_joblib: Dump) -> None:
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
