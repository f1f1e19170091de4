"""Reads what an evaluation compares: run folders, npz truths with motion.zarr's array names, and Pose2Sim truths.

Files come from strangers: no pickles, no array larger than a limit is ever allocated, and whatever is wrong is one
TruthError in one sentence.
"""

import contextlib
import json
import math
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import zarr

from humanmm.errors import InputError, TruthError
from humanmm.models.evaluation.truth import contract_sequence, pose2sim_sequence
from humanmm.models.records.sequence import MotionSequence

MAX_ARRAY_BYTES = 2**30
"""One array of an hour of video at 60 fps stays below this."""

MAX_ARRAYS = 10_000

MAX_JSON_BYTES = 64 * 2**20


def read_sequence(path: Path) -> MotionSequence:
    """The sequence in a run folder, a motion.zarr or an npz truth. Raises TruthError."""
    try:
        return _read(path)
    except InputError as error:
        raise TruthError(f"{path}: {error}") from error
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise TruthError(f"{path}: cannot be read as a run folder or truth ({_first_line(error)})") from error


def _read(path: Path) -> MotionSequence:
    if path.is_dir():
        for group in (path / "motion.zarr", path):
            if (group / "zarr.json").is_file():
                return contract_sequence(_ZarrArrays(group), transitions=_transitions(path / "run.json"))
        raise TruthError("neither a run folder nor a motion.zarr; expected motion.zarr/zarr.json in it")
    if not path.is_file():
        raise TruthError("does not exist; expected a run folder or an .npz truth")
    if not zipfile.is_zipfile(path):
        raise TruthError("not an .npz file; expected a run folder or an .npz truth")
    arrays = NpzArrays(path)
    if "joints3d" in arrays and "R_world2cam" in arrays:
        return pose2sim_sequence(arrays)
    if "num_frames" in arrays and "cut_frames" in arrays:
        return contract_sequence(arrays)
    raise TruthError(
        "no truth: expected motion.zarr's array names (num_frames, cut_frames, people/00/joints, …) or Pose2Sim's "
        f"(joints3d, R_world2cam, …), found {', '.join(sorted(arrays)[:6]) or 'nothing'}"
    )


@contextlib.contextmanager
def damage(what: str) -> Iterator[None]:
    """Raise what a library says of a damaged file as one TruthError: its words are about its own insides."""
    try:
        yield
    except (OSError, InputError):
        raise
    except Exception as error:  # zipfile, numpy, zarr and torch raise nearly all that there is
        raise TruthError(what) from error


class NpzArrays(Mapping[str, np.ndarray]):
    """The arrays of an npz by name, each read when it is used, after a check of its header."""

    def __init__(self, file: Path | BinaryIO, name: str = "") -> None:
        """`name` is what errors call a stream."""
        self._file = file
        name = file.name if isinstance(file, Path) else name
        with damage(f"{name} is no .npz, or it is damaged"), zipfile.ZipFile(file) as archive:
            names = archive.namelist()
        if len(names) > MAX_ARRAYS:
            raise TruthError(f"holds {len(names):,} files; expected at most {MAX_ARRAYS:,} arrays")
        self._names = {name.removesuffix(".npy"): name for name in names if name.endswith(".npy")}

    def __getitem__(self, key: str) -> np.ndarray:
        name = self._names[key]
        what = f"{key} is damaged, or not as numpy writes arrays"
        with damage(what), zipfile.ZipFile(self._file) as archive, archive.open(name) as member:
            version = np.lib.format.read_magic(member)
            if version == (1, 0):
                shape, _, dtype = np.lib.format.read_array_header_1_0(member)
            else:
                shape, _, dtype = np.lib.format.read_array_header_2_0(member)
            _check_size(key, shape, dtype)
            member.seek(0)
            return np.asarray(np.lib.format.read_array(member, allow_pickle=False))

    def __contains__(self, key: object) -> bool:
        return key in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


class _ZarrArrays(Mapping[str, np.ndarray]):
    """The arrays and attributes of a motion.zarr by name, as an npz truth has them."""

    def __init__(self, path: Path) -> None:
        with damage("motion.zarr is damaged"):
            self._group = zarr.open_group(path, mode="r")
            self._attributes = dict(self._group.attrs)
            people = self._group.get("people")
            names = sorted(people.group_keys()) if isinstance(people, zarr.Group) else []
            prefixes = ["", "cameras", *(f"people/{name}" for name in names)]
            self._arrays = [key for prefix in prefixes for key in _keys(self._group, prefix)]

    def __getitem__(self, key: str) -> np.ndarray:
        if key in self._attributes:
            return np.asarray(self._attributes[key])
        with damage(f"{key} is damaged"):
            array = self._group[key]
            if not isinstance(array, zarr.Array):
                raise TruthError(f"{key} is a group, expected an array")
            _check_size(key, array.shape, array.dtype)
            _check_size(f"a chunk of {key}", array.chunks, array.dtype)
            return np.asarray(array[...])

    def __contains__(self, key: object) -> bool:
        return key in self._attributes or key in self._arrays

    def __iter__(self) -> Iterator[str]:
        return iter([*self._attributes, *self._arrays])

    def __len__(self) -> int:
        return len(self._attributes) + len(self._arrays)


def _keys(group: zarr.Group, prefix: str) -> list[str]:
    child = group.get(prefix) if prefix else group
    return [f"{prefix}/{key}".lstrip("/") for key in child.array_keys()] if isinstance(child, zarr.Group) else []


def _check_size(key: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
    if dtype.hasobject:
        raise TruthError(f"{key} holds Python objects; expected plain numbers or names (no pickles)")
    size = math.prod(shape) * dtype.itemsize
    if min(shape, default=0) < 0:
        raise TruthError(f"{key} declares the shape {shape}")
    if size > MAX_ARRAY_BYTES:
        raise TruthError(f"{key} declares {size:,} bytes; expected at most {MAX_ARRAY_BYTES:,}")


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0][:200]


def _transitions(run_json: Path) -> tuple[tuple[int, int], ...] | None:
    """[start, end) of every change of shot as run.json has them; None where there is no run.json."""
    if not run_json.is_file():
        return None
    if run_json.stat().st_size > MAX_JSON_BYTES:
        raise TruthError(f"{run_json.name} is larger than {MAX_JSON_BYTES:,} bytes")
    shots = json.loads(run_json.read_text(encoding="utf-8"))["shots"]
    spans = []
    for shot in shots[1:]:
        transition = shot.get("transition") or {"start": shot["start"], "end": shot["start"]}
        spans.append((int(transition["start"]), int(transition["end"])))
    return tuple(spans)
