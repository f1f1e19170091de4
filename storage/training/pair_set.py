"""A set of pairs on a disk: one zarr group for every few windows, whole or not there at all."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from zarr.codecs import Crc32cCodec, ZstdCodec

from humanmm.errors import InputError
from humanmm.storage.store.files import replace_folder

Array = np.ndarray

SCHEMA = "humanmm.pairs/1"
IDENTITY, FACTS = "identity", "facts"


@dataclass(frozen=True)
class PairSet:
    """A folder of groups `<split>-<number>.zarr`; `identity` says what the pairs are made of."""

    folder: Path
    identity: str

    def has(self, name: str) -> bool:
        """Whether a group of this identity is there."""
        path = self._path(name)
        return (path / "zarr.json").is_file() and zarr.open_group(path, mode="r").attrs.get(IDENTITY) == self.identity

    def write(self, name: str, arrays: Mapping[str, Array], facts: Sequence[Mapping[str, Any]]) -> None:
        """Add a group; what was there under its name is replaced."""

        def fill(fresh: Path) -> None:
            group = zarr.open_group(fresh, mode="w")
            for key, array in arrays.items():
                group.create_array(key, data=array, chunks=array.shape, compressors=[ZstdCodec(level=3), Crc32cCodec()])
            group.attrs.update({"schema": SCHEMA, IDENTITY: self.identity, FACTS: json.dumps(list(facts))})

        replace_folder(self._path(name), fill)

    def _path(self, name: str) -> Path:
        return self.folder / f"{name}.zarr"


def read_pairs(folder: Path, split: str, kind: str = "pairs") -> tuple[dict[str, Array], list[dict[str, Any]]]:
    """All windows of a split: arrays (W, …), and what each window shows. InputError where there are none."""
    paths = sorted(folder.glob(f"{split}-*.zarr"))
    if not paths:
        raise InputError(f"{folder} holds no {kind} of the split {split}; make them with humanmm train {kind}")
    groups = [_opened(path) for path in paths]
    stored = [dict(group.arrays()) for group in groups]
    if any(parts.keys() != stored[0].keys() for parts in stored):
        raise InputError(f"{folder} holds groups of {split} that were made by different programs; make them anew")
    arrays: dict[str, Array] = {}
    for key, first in stored[0].items():  # in place: looks fill gigabytes, joined at last they would for a while twice
        ends = np.cumsum([parts[key].shape[0] for parts in stored])
        arrays[key] = np.empty((ends[-1], *first.shape[1:]), first.dtype)
        for parts, end in zip(stored, ends, strict=True):
            arrays[key][end - parts[key].shape[0] : end] = parts[key][:]
    return arrays, [one for group in groups for one in _facts(group)]


def read_group(path: Path) -> tuple[dict[str, Array], list[dict[str, Any]]]:
    """The windows of one group. InputError where it is something else."""
    group = _opened(path)
    return {key: np.asarray(array[:]) for key, array in group.arrays()}, _facts(group)


def _opened(path: Path) -> zarr.Group:
    group = zarr.open_group(path, mode="r")
    if group.attrs.get("schema") != SCHEMA:
        found = group.attrs.get("schema")
        raise InputError(f"{path} is no group of pairs: its schema is {found!r}, not {SCHEMA!r}")
    return group


def _facts(group: zarr.Group) -> list[dict[str, Any]]:
    facts: list[dict[str, Any]] = json.loads(str(group.attrs[FACTS]))
    return facts


def identity_of(parts: Mapping[str, Any]) -> str:
    """Digest of what decides the content of a set."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]
