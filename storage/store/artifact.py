"""One artifact: a folder with a json tree, a zarr v3 group, files, a manifest, and a commit marker.

    result.json     everything but the large arrays
    arrays.zarr/    the large arrays, zstd, crc32c on every chunk; absent when there are none
    files/          files that the stage wrote itself (pictures, video); absent when there are none
    manifest.json   recipe, content digest, and size and sha256 of every file above
    COMMIT          sha256 of manifest.json; an artifact without it does not exist

The manifest is what reveals damage: zarr omits chunks equal to the fill value, so a missing chunk proves nothing.
"""

import base64
import hashlib
import json
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict

from humanmm.storage.store.codec import Encoded, warnings_in
from humanmm.storage.store.files import file_sha256, sync_to_disk
from humanmm.storage.store.recipe import Recipe

SCHEMA = "humanmm.artifact/1"
CHUNK_BYTES = 8 << 20
_SYNC_THREADS = 8
INLINE_BYTES = 512
"""Arrays up to this size stand in result.json: two files and a folder less to write, sync and check for each."""


class Ref(BaseModel):
    """A reference to one artifact: small enough to travel between tasks; `uri` is relative, so a moved store still
    has it."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    stage: str
    unit: str
    key: str
    digest: str
    """Content digest of the decoded result and its files."""

    @property
    def uri(self) -> str:
        return artifact_uri(self.stage, self.key)


def artifact_uri(stage: str, key: str) -> str:
    """The folder of an artifact, relative to the root of its store."""
    return f"artifacts/{stage}/{key[:2]}/{key}"


class DamageError(Exception):
    """An artifact differs from its manifest; the message says how."""


@dataclass(frozen=True)
class Manifest:
    """The content of an artifact, and what it was made of."""

    recipe: Recipe
    unit: str
    digest: str
    files: Mapping[str, tuple[int, str]]
    """Path in the artifact → size, sha256."""
    seconds: float
    """How long the stage took."""
    created: str
    """When, ISO 8601."""
    version: str
    """Of humanmm."""
    warnings: tuple[str, ...] = ()

    @property
    def ref(self) -> Ref:
        return Ref(stage=self.recipe.stage, unit=self.unit, key=self.recipe.key, digest=self.digest)

    @property
    def num_bytes(self) -> int:
        return sum(size for size, _ in self.files.values())

    def to_json(self) -> dict[str, Any]:
        return {"schema": SCHEMA, **self.__dict__, "recipe": self.recipe.to_json()}

    @classmethod
    def from_json(cls, tree: Mapping[str, Any]) -> "Manifest":
        if tree.get("schema") != SCHEMA:
            raise DamageError(f"its manifest has schema {tree.get('schema')!r}, expected {SCHEMA!r}")
        fields = {name: value for name, value in tree.items() if name != "schema"}
        fields["recipe"] = Recipe.from_json(fields["recipe"])
        fields["files"] = {path: (int(size), str(sha)) for path, (size, sha) in fields["files"].items()}
        fields["warnings"] = tuple(fields["warnings"])
        return cls(**fields)


def write_artifact(
    folder: Path, encoded: Encoded, recipe: Recipe, *, unit: str, seconds: float, created: str, version: str
) -> Manifest:
    """Complete an artifact in `folder`, whose files/ the stage has filled, and sync it to the disk."""
    small = {path: array for path, array in encoded.arrays.items() if array.nbytes <= INLINE_BYTES}
    large = {path: array for path, array in encoded.arrays.items() if path not in small}
    tree = {"result": encoded.tree, "arrays": {path: _inline(array) for path, array in small.items()}}
    (folder / "result.json").write_text(json.dumps(tree, allow_nan=False))
    if large:
        _write_arrays(folder / "arrays.zarr", large)
    if (folder / "files").is_dir() and not any((folder / "files").iterdir()):
        (folder / "files").rmdir()
    files = {path: ((folder / path).stat().st_size, file_sha256(folder / path)) for path in _files_in(folder)}
    digest = encoded.digest({path: sha for path, (_, sha) in files.items() if path.startswith("files/")})
    manifest = Manifest(
        recipe, unit, digest, files, round(seconds, 3), created, version, tuple(warnings_in(encoded.tree))
    )
    text = json.dumps(manifest.to_json(), indent=1, ensure_ascii=False).encode()
    (folder / "manifest.json").write_bytes(text)
    (folder / "COMMIT").write_text(hashlib.sha256(text).hexdigest())
    _sync(folder)
    return manifest


def read_manifest(folder: Path) -> Manifest:
    """The manifest, checked against the commit marker."""
    try:
        text = (folder / "manifest.json").read_bytes()
        marker = (folder / "COMMIT").read_text()
    except FileNotFoundError as error:
        raise DamageError(f"{Path(error.filename).name} is missing") from error
    except UnicodeDecodeError as error:
        raise DamageError("COMMIT is not text") from error
    if hashlib.sha256(text).hexdigest() != marker.strip():
        raise DamageError("manifest.json does not match COMMIT")
    return Manifest.from_json(json.loads(text))


def check_files(folder: Path, manifest: Manifest) -> None:
    """Read every byte and compare with the manifest; DamageError names the file and what is wrong with it."""
    for path, (size, sha) in manifest.files.items():
        try:
            found = (folder / path).stat().st_size
            if found != size:
                raise DamageError(f"{path} has {found} bytes, expected {size}")
            if file_sha256(folder / path) != sha:
                raise DamageError(f"{path} has changed (sha256 differs)")
        except FileNotFoundError as error:
            raise DamageError(f"{path} is missing") from error
    for path in _files_in(folder):
        if path not in manifest.files and path not in ("manifest.json", "COMMIT"):
            raise DamageError(f"{path} does not belong to it")


def read_encoded(folder: Path, manifest: Manifest) -> Encoded:
    """The json tree and all arrays; DamageError if they have changed since `check_files`.

    zarr checks chunks against their crc32c; the json files are checked here.
    """
    for path, (_, sha) in manifest.files.items():
        if path.endswith(".json") and not path.startswith("files/") and file_sha256(folder / path) != sha:
            raise DamageError(f"{path} has changed (sha256 differs)")
    tree = json.loads((folder / "result.json").read_bytes())
    small = {path: _from_inline(array) for path, array in tree["arrays"].items()}
    return Encoded(tree["result"], small | _read_arrays(folder / "arrays.zarr"))


def _inline(array: np.ndarray) -> dict[str, Any]:
    data = base64.b64encode(np.ascontiguousarray(array).tobytes()).decode()
    return {"dtype": array.dtype.str, "shape": list(array.shape), "base64": data}


def _from_inline(entry: Mapping[str, Any]) -> np.ndarray:
    values = np.frombuffer(base64.b64decode(entry["base64"]), np.dtype(entry["dtype"]))
    return values.reshape(entry["shape"]).copy()


def _write_arrays(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    import zarr
    from zarr.codecs import BytesCodec, Crc32cCodec, ZstdCodec

    group = zarr.open_group(path, mode="w", zarr_format=3)
    for name, array in arrays.items():
        rows = max(1, CHUNK_BYTES // max(1, array[:1].nbytes)) if array.ndim else 1
        chunks = tuple(max(1, min(rows, side) if axis == 0 else side) for axis, side in enumerate(array.shape))
        group.create_array(
            name,
            data=np.ascontiguousarray(array).reshape(array.shape),
            chunks=chunks,
            chunk_key_encoding={"name": "default", "separator": "."},  # no folder per dimension
            serializer=BytesCodec(endian="little" if array.dtype.itemsize > 1 else None),
            compressors=[ZstdCodec(level=1), Crc32cCodec()],
        )


def _read_arrays(path: Path) -> dict[str, np.ndarray]:
    if not path.is_dir():
        return {}
    import zarr

    group = zarr.open_group(path, mode="r")
    return {name: np.asarray(item[...]) for name, item in group.members(max_depth=None) if isinstance(item, zarr.Array)}


def _files_in(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def _sync(folder: Path) -> None:
    """Sync every file and folder to the disk, in parallel: the file system then writes its journal once for many."""
    with ThreadPoolExecutor(_SYNC_THREADS) as threads:
        list(threads.map(sync_to_disk, [*folder.rglob("*"), folder]))
