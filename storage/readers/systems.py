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

import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from humanmm.errors import InputError
from humanmm.models.benchmark.imported import gvhmr_result, imported_sequence, slahmr_result, tram_result, wham_result
from humanmm.models.records.sequence import MotionSequence
from humanmm.storage.readers.restricted_pickle import MAX_BYTES, read_pickle
from humanmm.storage.readers.truth import NpzArrays, damage, read_sequence

READER_VERSION = 1
"""Raised whenever a reader gives another motion for the same file: figures that were kept are then made again."""

SUFFIXES = (".pt", ".pkl", ".npz")
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
        with damage("it cannot be read as another system's result"):
            sequence = _read(path, num_frames, fps)
    except (InputError, OSError) as error:
        words = str(error)
        raise InputError(words if words.startswith(str(path)) else f"{path}: {words}") from error
    person = sequence.people[0] if sequence.people else None
    if person is None or not len(person.frame):
        raise InputError(f"{path} holds no person")
    if not np.isfinite(person.joints).all():
        raise InputError(f"{path} holds joints that are not finite numbers")
    if person.frame[-1] >= num_frames + MAX_EXTRA_FRAMES:
        raise InputError(
            f"{path} holds frames {person.frame[0]} to {person.frame[-1]}, the video has {num_frames}: "
            "is it of another video, or was the video brought to another rate?"
        )
    return sequence


def _read(path: Path, num_frames: int, fps: float) -> MotionSequence:
    if path.suffix == ".pt":
        result = gvhmr_result(_gvhmr_parameters(path))
    elif path.suffix == ".pkl":
        result = wham_result(_wham_tracks(path))
    else:
        arrays = NpzArrays(path)
        if "pose_body" in arrays and "root_orient" in arrays:
            result = slahmr_result(arrays)
        elif "pred_rotmat" in arrays:
            result = tram_result(arrays)
        else:
            return read_sequence(path)
    return imported_sequence(result, num_frames=num_frames, fps=fps)


def _gvhmr_parameters(path: Path) -> dict[str, Any]:
    import torch

    if zipfile.is_zipfile(path):
        with damage("it is damaged"), zipfile.ZipFile(path) as file:
            size = sum(member.file_size for member in file.infolist())
        if size > MAX_BYTES:
            raise InputError(f"it declares {size:,} bytes; expected at most {MAX_BYTES:,}")
    with damage("it cannot be read: it is no file of torch, is damaged, or holds more than plain tensors"):
        tree = torch.load(path, map_location="cpu", weights_only=True)
    if not isinstance(tree, dict) or not isinstance(tree.get("smpl_params_global"), dict):
        raise InputError("it lacks smpl_params_global: it is no hmr4d_results.pt of GVHMR")
    return {str(name): _array_of(str(name), value) for name, value in tree["smpl_params_global"].items()}


def _array_of(name: str, value: Any) -> Any:
    """A tensor as an array; the error for anything else names it."""
    import torch

    if not isinstance(value, torch.Tensor):
        return value
    is_plain = not (value.is_nested or value.is_quantized) and value.layout == torch.strided
    if not is_plain or value.device.type != "cpu":
        kind = (
            "nested"
            if value.is_nested
            else "quantized"
            if value.is_quantized
            else f"{value.device.type} {value.layout}"
        )
        raise InputError(f"{name} is a tensor of another kind ({kind}); expected plain numbers")
    if value.numel() * 8 > MAX_BYTES:
        raise InputError(f"{name} declares {value.numel():,} numbers")
    return (value.detach().double() if value.is_floating_point() else value).numpy()


def _wham_tracks(path: Path) -> list[dict[str, Any]]:
    tree = read_pickle(path)
    tracks = [t for t in tree.values() if isinstance(t, dict) and "pose_world" in t] if isinstance(tree, dict) else []
    if not tracks:
        raise InputError("it holds no track with pose_world: it is no wham_output.pkl of WHAM")
    return tracks
