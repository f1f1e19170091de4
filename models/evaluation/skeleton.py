"""Joints that two skeletons share, by name: SMPL's 24, or the twelve limb joints of OpenPose, COCO and the like."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from humanmm.models.body.body24 import JOINT_NAMES

SMPL_NAMES = JOINT_NAMES

LIMB_NAMES = (
    "L_Shoulder", "R_Shoulder", "L_Elbow", "R_Elbow", "L_Wrist", "R_Wrist",
    "L_Hip", "R_Hip", "L_Knee", "R_Knee", "L_Ankle", "R_Ankle",
)  # fmt: skip
"""The joints on which every skeleton agrees well enough to be compared."""

FOOT_NAMES = ("L_Ankle", "L_Foot", "R_Ankle", "R_Foot")
"""In the order of `contacts`."""

_SAME = {"lbigtoe": "lfoot", "rbigtoe": "rfoot", "lfootindex": "lfoot", "rfootindex": "rfoot", "ltoebase": "lfoot",
         "rtoebase": "rfoot", "hips": "pelvis"}  # fmt: skip


def canonical(name: str) -> str:
    """The name without its spelling: "L_Hip", "LHip", "left_hip" and "LeftHip" are one."""
    plain = name.lower().replace("_", "").replace(" ", "").replace("-", "")
    plain = plain.replace("left", "l", 1) if plain.startswith("left") else plain
    plain = plain.replace("right", "r", 1) if plain.startswith("right") else plain
    return _SAME.get(plain, plain)


def indices(joint_names: Sequence[str], wanted: Sequence[str]) -> list[int] | None:
    """Where the wanted joints stand in joint_names; None if one of them is not there."""
    where = {canonical(name): index for index, name in reversed(list(enumerate(joint_names)))}
    found = [where.get(canonical(name)) for name in wanted]
    return None if any(index is None for index in found) else [index for index in found if index is not None]


def is_full(joint_names: Sequence[str]) -> bool:
    """True for SMPL's 24 joints."""
    return indices(joint_names, SMPL_NAMES) is not None


def shared_names(one: Sequence[str], other: Sequence[str]) -> tuple[str, ...] | None:
    """The 24 joints if both have them all, else the twelve limb joints, else None."""
    for names in (SMPL_NAMES, LIMB_NAMES):
        if indices(one, names) is not None and indices(other, names) is not None:
            return names
    return None


def pick(
    joints: Float[np.ndarray, "frames joints 3"], joint_names: Sequence[str], wanted: Sequence[str]
) -> Float[np.ndarray, "frames wanted 3"]:
    """The wanted joints, in that order. Raises KeyError if one is missing."""
    where = indices(joint_names, wanted)
    if where is None:
        raise KeyError(f"not all of {', '.join(wanted)} are among {', '.join(joint_names)}")
    return joints[:, where]


def mid_hip(joints: Float[np.ndarray, "frames joints 3"], joint_names: Sequence[str]) -> Float[np.ndarray, "frames 3"]:
    """(N,3) the middle of the two hip joints: the root of all root-relative errors."""
    return np.asarray(pick(joints, joint_names, ("L_Hip", "R_Hip")).mean(axis=1))
