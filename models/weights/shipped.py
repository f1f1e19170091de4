"""Reading shipped weight files: streamed, and checked against `manifest.json` before anything uses them."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from importlib.resources.abc import Traversable

from humanmm.errors import WeightsError

MANIFEST = "manifest.json"
_BLOCK = 1 << 20


@dataclass(frozen=True)
class WeightFile:
    """One line of the manifest."""

    name: str
    sha256: str
    size: int
    licence: str
    licence_file: str
    source: str
    purpose: str


def folder() -> Traversable:
    """Where the weight files lie inside the installed package."""
    return files("humanmm.models.weights")


@lru_cache(maxsize=1)
def manifest() -> Mapping[str, WeightFile]:
    """All shipped weight files by name. Raises WeightsError when the manifest itself is missing or unreadable."""
    try:
        entries = json.loads((folder() / MANIFEST).read_text(encoding="utf-8"))["files"]
        return {entry["name"]: WeightFile(**entry) for entry in entries}
    except (OSError, ValueError, KeyError, TypeError) as error:
        message = f"the list of weight files ({MANIFEST}) cannot be read: {error}; reinstall humanmm"
        raise WeightsError(message) from error


def read_weights(name: str) -> bytes:
    """The bytes of one weight file.

    Raises WeightsError when the file is unknown, missing, or its sha256 differs from the manifest's.
    """
    entry = manifest().get(name)
    if entry is None:
        raise WeightsError(f"no weight file is called {name!r}; expected one of {', '.join(sorted(manifest()))}")
    return read_checked(folder() / name, entry)


def read_checked(path: Traversable, entry: WeightFile) -> bytes:
    """The bytes of the file at path, which must be the file that entry describes."""
    digest, blocks = hashlib.sha256(), []
    try:
        with path.open("rb") as stream:
            while block := stream.read(_BLOCK):
                digest.update(block)
                blocks.append(block)
    except OSError as error:
        raise WeightsError(f"weight file {entry.name} cannot be read: {error}; reinstall humanmm") from error
    if digest.hexdigest() != entry.sha256:
        raise WeightsError(
            f"weight file {entry.name} has sha256 {digest.hexdigest()[:12]}…, the manifest says {entry.sha256[:12]}…: "
            "the file is damaged or was replaced; reinstall humanmm"
        )
    return b"".join(blocks)
