"""The arrays of an npz and of a motion.zarr, by name, from files of strangers.

No pickles, and nothing is taken by what a few bytes claim: sizes, links, pipes, copies of one name and compression are
looked at before anything is unpacked. Whatever is wrong is one TruthError in one sentence.
"""

import contextlib
import math
import stat
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import zarr
from zarr.codecs import BytesCodec, Crc32cCodec, ZstdCodec
from zarr.core.metadata import ArrayV3Metadata

from humanmm.errors import InputError, TruthError
from humanmm.models.records.foreign_arrays import shown

MAX_ARRAY_BYTES = 2**30
"""One array of an hour of video at 60 fps stays below this."""

MAX_FOLDER_BYTES = 2**32

MAX_ARRAYS = 10_000

_CODECS = (BytesCodec, ZstdCodec, Crc32cCodec)
"""How motion.zarr is written. Others would unpack as much as a few bytes ask for."""

_ZSTD = b"\x28\xb5\x2f\xfd"


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
        name = file.name if isinstance(file, Path) else name
        with damage(f"{name} is no .npz, or it is damaged"):
            self._file = zipfile.ZipFile(file)  # kept open: each opening reads the list of all files
        names = self._file.namelist()
        if len(names) > MAX_ARRAYS:
            raise TruthError(f"holds {len(names):,} files; expected at most {MAX_ARRAYS:,} arrays")
        self._names = {name.removesuffix(".npy"): name for name in names if name.endswith(".npy")}
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise TruthError(f"holds {shown(twice.removesuffix('.npy'))} more than once")

    def __getitem__(self, key: str) -> np.ndarray:
        name = self._names[key]
        with damage(f"{key} is damaged, or not as numpy writes arrays"), self._file.open(name) as member:
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


class ZarrArrays(Mapping[str, np.ndarray]):
    """The arrays and attributes of a motion.zarr by name, as an npz truth has them."""

    def __init__(self, path: Path) -> None:
        _check_folder(path)
        with damage("motion.zarr is damaged"):
            self._group = zarr.open_group(path, mode="r", zarr_format=3)
            self._attributes = dict(self._group.attrs)
            people = self._group.get("people")
            names = sorted(people.group_keys()) if isinstance(people, zarr.Group) else []
            prefixes = ["", "cameras", *(f"people/{name}" for name in names)]
            self._arrays = [key for prefix in prefixes for key in _keys(self._group, prefix)]

    def __getitem__(self, key: str) -> np.ndarray:
        with damage(f"{key} is no array of numbers or names"):
            if key in self._attributes:
                return np.asarray(self._attributes[key])
        with damage(f"{key} is damaged"):
            array = self._group[key]
            if not isinstance(array, zarr.Array):
                raise TruthError(f"{key} is a group, expected an array")
            _check_size(key, array.shape, array.dtype)
            _check_size(f"a chunk of {key}", array.chunks, array.dtype)
            _check_codecs(key, array)
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


def _check_codecs(key: str, array: zarr.Array[Any]) -> None:
    codecs = array.metadata.codecs if isinstance(array.metadata, ArrayV3Metadata) else ()
    for codec in codecs:
        if not isinstance(codec, _CODECS):
            raise TruthError(
                f"{key} is packed by {type(codec).__name__}; expected zstd, as `humanmm recover` writes it"
            )


def _check_folder(path: Path) -> None:
    """A folder may hold what never ends: a link to a device, a pipe, a file that unpacks to more than memory holds."""
    total, unpacked = 0, 0
    for count, file in enumerate(path.rglob("*")):
        status = file.lstat()
        name = shown(str(file.relative_to(path)))
        if count > 10 * MAX_ARRAYS:
            raise TruthError(f"motion.zarr holds more than {10 * MAX_ARRAYS:,} files")
        if stat.S_ISDIR(status.st_mode):
            continue
        if not stat.S_ISREG(status.st_mode):
            raise TruthError(f"motion.zarr/{name} is a link or no regular file; expected plain files alone")
        total += status.st_size
        unpacked += _unpacked_bytes(file, name)
        if max(total, unpacked) > MAX_FOLDER_BYTES:
            raise TruthError(f"motion.zarr unpacks to more than {MAX_FOLDER_BYTES:,} bytes")


def _unpacked_bytes(file: Path, name: str) -> int:
    """What a file of zstd says that it unpacks to (RFC 8878, 3.1.1.1), as libzstd believes; 0 of others."""
    with file.open("rb") as stream:
        head = stream.read(18)
    if head[:4] != _ZSTD or len(head) < 6:
        return 0
    flags = head[4]
    is_whole = flags >> 5 & 1
    at = 5 + (1 - is_whole) + (0, 1, 2, 4)[flags & 3]
    length = (is_whole, 2, 4, 8)[flags >> 6]
    if not length:
        raise TruthError(f"motion.zarr/{name} does not say how large it is unpacked")
    return int.from_bytes(head[at : at + length], "little") + (256 if length == 2 else 0)
