"""Reads the user's own SMPL and SMPL-X models, for truths that come without joints."""

import zipfile
from pathlib import Path

import numpy as np

from humanmm.errors import InputError, TruthError
from humanmm.models.body.smpl_joints import SmplJoints
from humanmm.storage.readers.archives import NpzArrays

_FINGERS = (28, 43)
"""SMPL-X's left_middle1 and right_middle1."""


def read_smpl(path: Path) -> SmplJoints:
    """From an .npz with v_template (V,3), shapedirs (V,3,≥10) and J_regressor (24,V)."""
    return _read(path, slice(None), "SMPL (smpl.is.tue.mpg.de, its licence)")


def read_smplx(path: Path) -> SmplJoints:
    """From the .npz of SMPL-X: its body has SMPL's joints; SMPL's hand is the middle finger's first joint."""
    return _read(path, [*range(22), *_FINGERS], "SMPL-X (smpl-x.is.tue.mpg.de, its licence)")


def _read(path: Path, rows: slice | list[int], name: str) -> SmplJoints:
    try:
        arrays = NpzArrays(path)
        regressor = np.asarray(arrays["J_regressor"][rows], np.float64)
        return SmplJoints.of_mesh(regressor, arrays["v_template"], arrays["shapedirs"][..., :10])
    except (OSError, ValueError, KeyError, IndexError, zipfile.BadZipFile, TruthError) as error:
        raise InputError(
            f"{path} is not {name.split()[0]} as .npz with v_template, shapedirs and J_regressor ({error}); get {name} "
            "and save these arrays without pickles"
        ) from None
