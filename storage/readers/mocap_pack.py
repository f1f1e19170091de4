"""Reads a pack of motion capture: an npz with all sequences one after another, y up, SMPL's joint order.

poses (N,72)  trans (N,3) pelvis joint  contacts (N,4)  clip_start clip_len clip_name (C,)  rest_joints (24,3)  fps
"""

from pathlib import Path

import numpy as np

from humanmm.errors import InputError, TruthError
from humanmm.models.body.body24 import NUM_JOINTS, PARENTS
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.synthetic.mocap import MocapSequence, leg_length
from humanmm.storage.readers.truth import R_ZUP_YUP, NpzArrays

FPS = 30.0
"""Packs at a multiple of this are thinned out to it: the paper's videos have 30 frames a second."""

_SHAPES: dict[str, tuple[int | None, ...]] = {
    "poses": (None, 3 * NUM_JOINTS), "trans": (None, 3), "contacts": (None, 4), "clip_start": (None,),
    "clip_len": (None,), "clip_name": (None,), "rest_joints": (NUM_JOINTS, 3), "fps": (),
}  # fmt: skip


def read_pack(path: Path) -> tuple[MocapSequence, ...]:
    """All sequences, world z up. InputError says in one sentence what is wrong with the file."""
    try:
        arrays = {name: np.asarray(array) for name, array in NpzArrays(path).items() if name in (*_SHAPES, "parents")}
    except (OSError, ValueError, KeyError, EOFError, TruthError) as error:
        raise InputError(f"{path} cannot be read as a pack of motion capture (.npz): {error}") from error
    _check(arrays, path)
    step = max(1, round(float(arrays["fps"]) / FPS))
    leg_m = leg_length(arrays["rest_joints"].astype(np.float64))
    R = rotvec_to_rotmat(arrays["poses"][:, :3])
    sequences = []
    for name, start, length in zip(
        arrays["clip_name"].tolist(), arrays["clip_start"].tolist(), arrays["clip_len"].tolist(), strict=True
    ):
        rows = slice(start, start + length, step)
        sequences.append(
            MocapSequence(
                name=str(name),
                fps=float(arrays["fps"]) / step,
                R_world_root=R_ZUP_YUP @ R[rows],
                body_pose=arrays["poses"][rows, 3:].astype(np.float64).reshape(-1, NUM_JOINTS - 1, 3),
                pelvis=arrays["trans"][rows].astype(np.float64) @ R_ZUP_YUP.T,
                contacts=arrays["contacts"][rows].astype(np.float64),
                leg_m=leg_m,
            )
        )
    return tuple(sequences)


def _check(arrays: dict[str, np.ndarray], path: Path) -> None:
    for name, shape in _SHAPES.items():
        if name not in arrays:
            raise InputError(f"{path} is no pack of motion capture: it lacks {name}")
        found = arrays[name].shape
        if len(found) != len(shape) or any(want not in (None, have) for want, have in zip(shape, found, strict=True)):
            raise InputError(f"{path}: {name} has shape {found}, expected {shape}")
    n, clips = len(arrays["poses"]), len(arrays["clip_start"])
    if len(arrays["trans"]) != n or len(arrays["contacts"]) != n or len(arrays["clip_len"]) != clips:
        raise InputError(f"{path}: poses, trans and contacts, or clip_start and clip_len, differ in length")
    if len(arrays["clip_name"]) != clips or clips == 0:
        raise InputError(f"{path}: {clips} sequences but {len(arrays['clip_name'])} names; at least one is needed")
    start, length = arrays["clip_start"], arrays["clip_len"]
    if (start < 0).any() or (length < 1).any() or (start + length > n).any():
        raise InputError(f"{path}: a sequence lies outside the {n} frames of the pack")
    if "parents" in arrays and tuple(arrays["parents"].tolist()) != PARENTS:
        raise InputError(f"{path}: its joints are not in SMPL's order")
    if not float(arrays["fps"]) > 0 or not all(np.isfinite(arrays[k]).all() for k in ("poses", "trans", "rest_joints")):
        raise InputError(f"{path}: fps, poses, trans and rest_joints must be finite numbers, fps above 0")
