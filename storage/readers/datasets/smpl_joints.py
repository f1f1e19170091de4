"""Joints of SMPL parameters, for truths that come without joints: a user's own SMPL model, never shipped.

SMPL's joints are J(β) = J_regressor (v_template + shapedirs β), posed by forward kinematics; transl moves the pelvis
from J₀(β) (Loper et al. 2015, equations 6 and 10, without pose-dependent blend shapes, which move no joint).
"""

import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from humanmm.errors import InputError, TruthError
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.storage.readers.truth import NpzArrays

_FINGERS = (28, 43)
"""SMPL-X's left_middle1 and right_middle1."""


@dataclass(frozen=True)
class SmplJoints:
    """The part of an SMPL model that places joints."""

    J_template: Float[np.ndarray, "24 3"]
    J_shapedirs: Float[np.ndarray, "24 3 10"]

    def posed(
        self,
        root_orient: Float[np.ndarray, "F 3"],
        body_pose: Float[np.ndarray, "F 69"],
        betas: Float[np.ndarray, "10"],
        transl: Float[np.ndarray, "F 3"],
    ) -> Float[np.ndarray, "F 24 3"]:
        """Joints in the axes of the parameters, metres."""
        rest = self.J_template + self.J_shapedirs @ betas
        R_root = rotvec_to_rotmat(root_orient)
        return forward_kinematics(rest, R_root, body_pose.reshape(-1, 23, 3), transl + rest[0])[0]


def read_smpl(path: Path) -> SmplJoints:
    """From an .npz with v_template (V,3), shapedirs (V,3,≥10) and J_regressor (24,V)."""
    return _read(path, slice(None), "SMPL (smpl.is.tue.mpg.de, its licence)")


def read_smplx(path: Path) -> SmplJoints:
    """From the .npz of SMPL-X: its body has SMPL's joints, for a hand stands the middle finger's first."""
    return _read(path, [*range(22), *_FINGERS], "SMPL-X (smpl-x.is.tue.mpg.de, its licence)")


def _read(path: Path, rows: slice | list[int], name: str) -> SmplJoints:
    try:
        arrays = NpzArrays(path)
        vertices, directions = arrays["v_template"], arrays["shapedirs"][..., :10]
        regressor = np.asarray(arrays["J_regressor"][rows], np.float64)
        return SmplJoints(regressor @ vertices, np.einsum("jv,vab->jab", regressor, directions))
    except (OSError, ValueError, KeyError, IndexError, zipfile.BadZipFile, TruthError) as error:
        raise InputError(
            f"{path} is not {name.split()[0]} as .npz with v_template, shapedirs and J_regressor ({error}); get {name} "
            "and save these arrays without pickles"
        ) from None
