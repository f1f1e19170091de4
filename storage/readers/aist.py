"""Reads one sequence of AIST++'s annotations: an npz with calibrated cameras, 2D detections, and joints in 3D.

keypoints2d (C,F,17,3) pixels and score; keypoints3d_optim or keypoints3d (F,17,3) cm, y up; cam_K cam_rotvec cam_t
(C,…) world to camera, cm; cam_size (2,) or (2C,) or (C,2); fps. C cameras, F frames. `humanmm dataset build ms-aist`
writes such files from the official folders.
"""

import hashlib
from pathlib import Path

import numpy as np

from humanmm.errors import InputError, TruthError
from humanmm.models.benchmark.aist import AistSequence, aist_sequence
from humanmm.storage.readers.archives import NpzArrays

_SHAPES: dict[str, tuple[int | None, ...]] = {
    "keypoints2d": (None, None, 17, 3), "cam_K": (None, 3, 3), "cam_rotvec": (None, 3), "cam_t": (None, 3),
}  # fmt: skip


def read_aist(folder: Path) -> tuple[AistSequence, ...]:
    """All sequences of a folder, by name. InputError says in one sentence what is wrong with which file."""
    paths = sorted(folder.glob("*.npz")) if folder.is_dir() else []
    if not paths:
        raise InputError(f"{folder} holds no .npz; give a folder of AIST++ sequences as `bench ms-aist` reads them")
    return tuple(read_aist_sequence(path) for path in paths)


def read_aist_sequence(path: Path) -> AistSequence:
    """One sequence in metres, z up."""
    try:
        arrays = {name: np.asarray(array) for name, array in NpzArrays(path).items() if _is_wanted(name)}
    except (OSError, TruthError) as error:
        raise InputError(f"{path} cannot be read as an AIST++ sequence (.npz): {error}") from error
    truth = _checked(arrays, path)
    return aist_sequence(path.stem, hashlib.sha256(path.read_bytes()).hexdigest(), arrays, joints=truth)


def _is_wanted(name: str) -> bool:
    return name in (*_SHAPES, "keypoints3d", "keypoints3d_optim", "fps", "cam_size")


def _checked(arrays: dict[str, np.ndarray], path: Path) -> str:
    """Name of the array that holds the joints, once everything fits together."""
    truth = "keypoints3d_optim" if "keypoints3d_optim" in arrays else "keypoints3d"
    shapes = {**_SHAPES, truth: (None, 17, 3)}
    for name in (*shapes, "fps", "cam_size"):
        if name not in arrays:
            raise InputError(f"{path} is no AIST++ sequence: it lacks {name}")
        if arrays[name].dtype.kind not in "iuf":
            raise InputError(f"{path}: {name} has type {arrays[name].dtype}, expected numbers")
    for name, shape in shapes.items():
        found = arrays[name].shape
        if len(found) != len(shape) or any(want not in (None, have) for want, have in zip(shape, found, strict=True)):
            raise InputError(f"{path}: {name} has shape {found}, expected {shape} (None: any length)")
    cameras, frames = arrays["keypoints2d"].shape[:2]
    if cameras < 2 or any(len(arrays[name]) != cameras for name in ("cam_K", "cam_rotvec", "cam_t")):
        raise InputError(f"{path}: keypoints2d is of {cameras} cameras; at least two are needed, each with cam_K, …")
    if len(arrays[truth]) != frames:
        raise InputError(f"{path}: keypoints2d has {frames} frames, {truth} {len(arrays[truth])}")
    sizes = arrays["cam_size"].reshape(-1, 2) if arrays["cam_size"].size % 2 == 0 and arrays["cam_size"].size else None
    if sizes is None or (sizes != sizes[0]).any() or (sizes <= 0).any():
        raise InputError(f"{path}: cam_size must give one width and height for all cameras")
    finite = all(np.isfinite(arrays[name]).all() for name in ("cam_K", "cam_rotvec", "cam_t", "fps"))
    if not finite or not float(np.ravel(arrays["fps"])[0]) > 0:
        raise InputError(f"{path}: fps and cameras must be finite numbers, fps above 0")
    return truth
