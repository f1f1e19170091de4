"""Arrays of strangers' files: the error names the key, what was expected and what was found."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from humanmm.errors import InputError

Array = np.ndarray

MAX_ROWS = 2_000_000
MAX_NUMBERS = 2**27
"""1 GiB as float64, whatever the file takes for a number: an hour of video at 60 fps stays below this."""
LARGEST = 1e12
"""Neither metres nor pixels, seconds or turns: products of larger numbers end as infinity."""
SHOWN = 60
"""Characters of a stranger's word that a message quotes at most."""
ROUNDING = 0.02
"""By how much R Rᵀ of a rotation may differ from the identity: half floats, and text of three decimals."""


def numbers(
    arrays: Mapping[str, Any], key: str, shape: tuple[int | None, ...], *, finite: bool = False
) -> Float[Array, "..."]:
    """An array as float64; None in `shape` stands for any length up to a limit, axes of one too many are dropped."""
    array = _needed(arrays, key)
    while array.ndim > len(shape) and 1 in array.shape:
        array = array.squeeze(array.shape.index(1))
    fits = array.ndim == len(shape) and all(w in (None, h) for h, w in zip(array.shape, shape, strict=True))
    if not fits or (array.ndim and len(array) > MAX_ROWS):
        found = f"shape {_sides(array.shape)}" if array.ndim else "a single value"
        raise InputError(f"{key} has {found}; expected {_sides(shape) or 'a single number'}")
    if array.dtype.kind not in "fiub":
        raise InputError(f"{key} has type {shown(str(array.dtype))}; expected numbers")
    if array.size > MAX_NUMBERS:
        raise InputError(f"{key} holds {array.size:,} numbers; expected at most {MAX_NUMBERS:,}")
    if finite and not np.isfinite(array).all():
        row = int(np.argwhere(~np.isfinite(np.atleast_1d(array)))[0][0])
        raise InputError(f"{key} holds numbers that are not finite, the first in row {row}")
    array = array.astype(np.float64)
    beyond = np.isfinite(array) & (np.abs(array) > LARGEST)
    if beyond.any():
        raise InputError(f"{key} holds {array[beyond][0]:g}; expected numbers up to {LARGEST:g}")
    return array


def whole_numbers(arrays: Mapping[str, Any], key: str, shape: tuple[int | None, ...]) -> Int[Array, "..."]:
    """An array as int64."""
    array = numbers(arrays, key, shape, finite=True)
    wrong = array != np.rint(array)
    if wrong.any():
        raise InputError(f"{key} holds {array[wrong][0]}; expected whole numbers")
    return array.astype(np.int64)


def frame_numbers(arrays: Mapping[str, Any], key: str, num_rows: int | None, *, below: int | None = None) -> Array:
    """Frame numbers that rise strictly from 0 on, one a row, all less than `below`."""
    frame = whole_numbers(arrays, key, (num_rows,))
    if (frame < 0).any():
        raise InputError(f"{key} holds the negative frame {frame[frame < 0][0]}; frames count from 0")
    if (np.diff(frame) <= 0).any():
        at = int(np.flatnonzero(np.diff(frame) <= 0)[0])
        raise InputError(f"{key} does not rise strictly: {frame[at + 1]} follows {frame[at]}")
    if below is not None and len(frame) and frame[-1] >= below:
        raise InputError(f"{key} goes to frame {frame[-1]}; the frames end at {below - 1}")
    return frame


def rotations(
    arrays: Mapping[str, Any], key: str, shape: tuple[int | None, ...], *, finite: bool = False
) -> Float[Array, "... 3 3"]:
    """Rotation matrices; those that are not finite are not known, unless `finite` numbers are wanted."""
    R = numbers(arrays, key, shape, finite=finite)
    known = np.isfinite(R).all(axis=(-1, -2))
    with np.errstate(invalid="ignore"):
        differs = np.abs(R @ np.swapaxes(R, -1, -2) - np.eye(3)).max(axis=(-1, -2))
        wrong = known & (~(differs <= ROUNDING) | (np.linalg.det(np.where(known[..., None, None], R, 0)) < 0))
    if wrong.any():
        row = int(np.argwhere(wrong)[0][0])
        raise InputError(f"{key} holds {int(wrong.sum())} matrices that are no rotations, the first in row {row}")
    return R


def _needed(arrays: Mapping[str, Any], key: str) -> Array:
    if key not in arrays:
        raise InputError(f"{key} is missing")
    try:
        return np.asarray(arrays[key])
    except (ValueError, TypeError, RecursionError):
        raise InputError(f"{key} is no array of numbers") from None


def shown(word: str) -> str:
    """A stranger's word as a short, printable piece of a message: it may be long, or hold what a terminal obeys."""
    short = word if len(word) <= SHOWN else f"{word[: SHOWN - 1]}…"
    return short if short.isprintable() else ascii(short)


def _sides(shape: tuple[int | None, ...]) -> str:
    return "×".join("N" if side is None else str(side) for side in shape)
