"""Reads a pack of motion capture: an npz with all sequences one after another, y up, SMPL's joint order.

poses (N,72)  trans (N,3) pelvis joint  contacts (N,4)  clip_start clip_len clip_name (C,)  rest_joints (24,3)  fps
"""

from pathlib import Path

import numpy as np

from humanmm.errors import InputError, TruthError
from humanmm.models.body.body24 import NUM_JOINTS, PARENTS
from humanmm.models.synthetic.mocap import MocapSequence, sequences_of_pack
from humanmm.storage.readers.archives import NpzArrays

_SHAPES: dict[str, tuple[int | None, ...]] = {
    "poses": (None, 3 * NUM_JOINTS), "trans": (None, 3), "contacts": (None, 4), "clip_start": (None,),
    "clip_len": (None,), "clip_name": (None,), "rest_joints": (NUM_JOINTS, 3), "fps": (),
}  # fmt: skip
_OPTIONAL = ("parents", "clip_action", "clip_subject")


def read_pack(path: Path) -> tuple[MocapSequence, ...]:
    """All sequences, world z up. InputError says in one sentence what is wrong with the file."""
    try:
        arrays = {name: np.asarray(array) for name, array in NpzArrays(path).items() if name in (*_SHAPES, *_OPTIONAL)}
    except (OSError, TruthError) as error:
        raise InputError(f"{path} cannot be read as a pack of motion capture (.npz): {error}") from error
    _check(arrays, path)
    return sequences_of_pack(arrays)


def _check(arrays: dict[str, np.ndarray], path: Path) -> None:
    for name, shape in _SHAPES.items():
        if name not in arrays:
            raise InputError(f"{path} is no pack of motion capture: it lacks {name}")
        found = arrays[name].shape
        if len(found) != len(shape) or any(want not in (None, have) for want, have in zip(shape, found, strict=True)):
            raise InputError(f"{path}: {name} has shape {found}, expected {shape}")
        if name != "clip_name" and arrays[name].dtype.kind not in "iuf":
            raise InputError(f"{path}: {name} has type {arrays[name].dtype}, expected numbers")
    n, clips = len(arrays["poses"]), len(arrays["clip_start"])
    if len(arrays["trans"]) != n or len(arrays["contacts"]) != n or len(arrays["clip_len"]) != clips:
        raise InputError(f"{path}: poses, trans and contacts, or clip_start and clip_len, differ in length")
    if len(arrays["clip_name"]) != clips or clips == 0:
        raise InputError(f"{path}: {clips} sequences but {len(arrays['clip_name'])} names; at least one is needed")
    if any(key in arrays and arrays[key].shape != (clips,) for key in ("clip_action", "clip_subject")):
        raise InputError(f"{path}: clip_action and clip_subject must have one entry for each of the {clips} sequences")
    start, length = arrays["clip_start"], arrays["clip_len"]
    if (start < 0).any() or (length < 1).any() or (start + length > n).any():
        raise InputError(f"{path}: a sequence lies outside the {n} frames of the pack")
    if "parents" in arrays and tuple(arrays["parents"].tolist()) != PARENTS:
        raise InputError(f"{path}: its joints are not in SMPL's order")
    if not float(arrays["fps"]) > 0 or not all(np.isfinite(arrays[k]).all() for k in ("poses", "trans", "rest_joints")):
        raise InputError(f"{path}: fps, poses, trans and rest_joints must be finite numbers, fps above 0")
