"""Results of GVHMR, WHAM, SLAHMR and TRAM, and of any system as an npz with motion.zarr's names, as sequences.

| system | file | keys that are read | world |
|---|---|---|---|
| GVHMR | hmr4d_results.pt | smpl_params_global: global_orient (F,3), body_pose (F,63), transl (F,3) | y up |
| WHAM | wham_output.pkl (joblib) | of each track: pose_world (N,72), trans_world (N,3), frame_ids (N,) | y up |
| SLAHMR | …_world_results.npz | root_orient (B,T,3), pose_body (B,T,63), trans (B,T,3), floor_plane | first camera's |
| TRAM | .npz | pred_rotmat (N,24,3,3), pred_trans (N,3), frame (N,), pred_cam_R (T,3,3), pred_cam_T (T,3) | the same |

WHAM's and SLAHMR's keys are those their published code writes; no file of either was at hand, nor of TRAM, whose own
files are pickled: `np.savez(out, **{k: np.asarray(v) for k, v in {**camera, **track}.items()})` makes the npz from
np.load(…, allow_pickle=True).item() of its camera.npy and hps_track_0.npy. These three are experimental.
"""

import pickle
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from humanmm.errors import InputError, TruthError
from humanmm.models.benchmark.imported import SMPL_REST_PELVIS, SmplMotion, imported_sequence
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.records.sequence import MotionSequence
from humanmm.storage.readers.restricted_pickle import read_pickle
from humanmm.storage.readers.truth import NpzArrays, read_sequence

Array = np.ndarray

READER_VERSION = 1
"""Raised whenever a reader gives another motion for the same file: figures that were kept are then made again."""

SUFFIXES = (".pt", ".pkl", ".npz")
Y_UP, CAMERA_UP = np.array([0.0, 1.0, 0.0]), np.array([0.0, -1.0, 0.0])
MAX_EXTRA_FRAMES = 2
"""Decoders disagree about the last frames of a video; a result that is longer than that is of another video."""


def find_result(folder: Path, video: str) -> Path | None:
    """FOLDER/<video>.pt, .pkl or .npz, or the only such file in FOLDER/<video>/ (…_world_results.npz before others)."""
    for suffix in SUFFIXES:
        path = folder / f"{video}{suffix}"
        if path.is_file():
            return path
    inside = sorted(p for suffix in SUFFIXES for p in (folder / video).glob(f"*{suffix}"))
    named = [p for p in inside if p.name in ("hmr4d_results.pt", "wham_output.pkl")]
    named += [p for p in inside if p.name.endswith("_world_results.npz")][-1:]  # SLAHMR numbers its iterations
    chosen = named or inside
    return chosen[0] if len(chosen) == 1 else None


def read_result(path: Path, *, num_frames: int, fps: float) -> MotionSequence:
    """The motion of the main person. InputError says in one sentence what is wrong with the file."""
    try:
        sequence = _read(path, num_frames, fps)
    except (InputError, TruthError):
        raise
    except (OSError, ValueError, KeyError, TypeError, IndexError, EOFError, RuntimeError) as error:
        raise InputError(f"{path} cannot be read as another system's result: {_words(error)}") from error
    person = sequence.people[0] if sequence.people else None
    if person is None or not len(person.frame) or not np.isfinite(person.joints).all():
        raise InputError(f"{path} holds no person, or numbers that are not finite")
    if person.frame[0] < 0 or person.frame[-1] >= num_frames + MAX_EXTRA_FRAMES or (np.diff(person.frame) <= 0).any():
        raise InputError(
            f"{path} holds frames {person.frame[0]} to {person.frame[-1]}, the video has {num_frames}: "
            "is it of another video, or was the video brought to another rate?"
        )
    return sequence


def _read(path: Path, num_frames: int, fps: float) -> MotionSequence:
    notes: tuple[str, ...] = ()
    if path.suffix == ".pt":
        motion, up = _gvhmr(path), Y_UP
    elif path.suffix == ".pkl":
        motion, notes = _wham(path)
        up = Y_UP
    else:
        arrays = NpzArrays(path)
        if "pose_body" in arrays and "root_orient" in arrays:
            motion, up, notes = _slahmr(arrays)
        elif "pred_rotmat" in arrays:
            motion, up = _tram(arrays)
        else:
            return read_sequence(path)
    return imported_sequence(motion, up=up, num_frames=num_frames, fps=fps, notes=notes)


def _gvhmr(path: Path) -> SmplMotion:
    import torch

    try:
        tree = torch.load(path, map_location="cpu", weights_only=True)
    except pickle.UnpicklingError:
        raise InputError(f"{path} cannot be read: it is no file of torch, or holds more than plain tensors") from None
    if not isinstance(tree, dict) or not isinstance(tree.get("smpl_params_global"), dict):
        raise InputError(f"{path} lacks smpl_params_global: it is no hmr4d_results.pt of GVHMR")
    params = {name: np.asarray(value, np.float64) for name, value in tree["smpl_params_global"].items()}
    orient = _rows(params, "global_orient", 3)
    pose = _rows(params, "body_pose", 63)
    return SmplMotion(
        np.arange(len(orient)), rotvec_to_rotmat(orient), pose.reshape(len(pose), -1, 3), _rows(params, "transl", 3)
    )


def _wham(path: Path) -> tuple[SmplMotion, tuple[str, ...]]:
    tree = read_pickle(path)
    tracks = [t for t in tree.values() if isinstance(t, dict) and "pose_world" in t] if isinstance(tree, dict) else []
    if not tracks:
        raise InputError(f"{path} holds no track with pose_world: it is no wham_output.pkl of WHAM")
    track = max(tracks, key=lambda one: len(one["frame_ids"]))
    pose = _rows(track, "pose_world", 72).reshape(-1, 24, 3)
    frame = np.asarray(track["frame_ids"]).astype(np.int64)
    motion = SmplMotion(frame, rotvec_to_rotmat(pose[:, 0]), pose[:, 1:], _rows(track, "trans_world", 3))
    return motion, _of_many(len(tracks))


def _slahmr(arrays: Mapping[str, Array]) -> tuple[SmplMotion, Array, tuple[str, ...]]:
    orient, pose, trans = (arrays[name].astype(np.float64) for name in ("root_orient", "pose_body", "trans"))
    if orient.ndim == 2:  # a single track without its own axis
        orient, pose, trans = orient[None], pose[None], trans[None]
    up = CAMERA_UP
    if "floor_plane" in arrays:
        normal = arrays["floor_plane"].astype(np.float64).reshape(-1, arrays["floor_plane"].shape[-1])[0, :3]
        length = float(np.linalg.norm(normal))
        if length > 1e-6:
            up = normal / length * (1.0 if normal @ CAMERA_UP >= 0 else -1.0)
    frame = np.arange(orient.shape[1])
    motion = SmplMotion(frame, rotvec_to_rotmat(orient[0]), pose[0].reshape(len(frame), -1, 3), trans[0])
    return motion, up, _of_many(len(orient))


def _tram(arrays: Mapping[str, Array]) -> tuple[SmplMotion, Array]:
    R_cam_body = arrays["pred_rotmat"].astype(np.float64).reshape(-1, 24, 3, 3)
    trans, frame = arrays["pred_trans"].astype(np.float64).reshape(-1, 3), arrays["frame"].astype(np.int64).ravel()
    R, t = arrays["pred_cam_R"].astype(np.float64)[frame], arrays["pred_cam_T"].astype(np.float64).reshape(-1, 3)[frame]
    transl = (R @ (trans + SMPL_REST_PELVIS)[..., None])[..., 0] + t - SMPL_REST_PELVIS
    return SmplMotion(frame, R @ R_cam_body[:, 0], rotmat_to_rotvec(R_cam_body[:, 1:]), transl), CAMERA_UP


def _rows(arrays: Mapping[str, Any], name: str, width: int) -> Array:
    if name not in arrays:
        raise InputError(f"{name} is missing; expected {width} numbers a frame")
    array = np.asarray(arrays[name], np.float64)
    if array.shape[-1:] != (width,):
        raise InputError(f"{name} has shape {array.shape}; expected {width} numbers a frame")
    return array.reshape(-1, width)


def _of_many(count: int) -> tuple[str, ...]:
    return (f"{count} tracks were found; one is compared.",) if count > 1 else ()


def _words(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0][:200]
