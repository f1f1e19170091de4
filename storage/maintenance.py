"""Care of a store: what lies in it, whether it is sound, what can go."""

import contextlib
import fcntl
import json
import os
import shutil
import time
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from humanmm.storage.artifact import DamageError, Manifest, check_files, read_encoded, read_manifest
from humanmm.storage.codec import decode, encode
from humanmm.storage.store import TMP_GRACE_S, Store


@dataclass(frozen=True)
class Finding:
    """One artifact as `verify` found it."""

    uri: str
    problem: str
    """Empty if it is sound."""


@dataclass(frozen=True)
class Removable:
    """Something that `gc` may remove, and why."""

    path: Path
    num_bytes: int
    reason: str


def artifacts(store: Store) -> Iterator[Path]:
    """Folders of all artifacts, damaged ones included."""
    yield from sorted(store.root.glob("artifacts/*/??/*"))


def verify(store: Store, *, outputs: dict[str, str], deep: bool) -> Iterator[Finding]:
    """Check size and sha256 of every file; `deep` also decodes each result and compares its content digest.

    `outputs` maps a stage to the `module:class` of its result. What is damaged is set aside.
    """
    for folder in artifacts(store):
        uri = str(folder.relative_to(store.root))
        stage, key = folder.parts[-3], folder.name
        try:
            manifest = read_manifest(folder)
            if manifest.recipe.key != key:
                raise DamageError("its recipe does not give its key")
            check_files(folder, manifest)
            if deep and stage in outputs:
                _check_content(folder, manifest, outputs[stage])
            yield Finding(uri, "")
        except (DamageError, ValueError, TypeError, KeyError, OSError) as error:
            store.set_aside(stage, key, str(error))
            yield Finding(uri, str(error))


def usage(store: Store) -> dict[str, tuple[int, int]]:
    """Stage → number of artifacts, bytes on disk; `(damaged)` and `(unfinished)` for the rest."""
    totals: dict[str, tuple[int, int]] = {}
    places = [(folder, folder.parts[-3]) for folder in artifacts(store)]
    places += [(path, "(damaged)") for path in store.root.glob("damaged/*")]
    places += [(path, "(unfinished)") for path in store.root.glob("tmp/*")]
    for path, name in places:
        count, size = totals.get(name, (0, 0))
        totals[name] = (count + 1, size + _size(path))
    return totals


def removable(store: Store, *, unused_days: float) -> list[Removable]:
    """What nobody needs: leftovers, damaged artifacts, and artifacts not used for so many days."""
    now = time.time()
    found = []
    for path in sorted(store.root.glob("tmp/*")):
        if now - path.stat().st_mtime > TMP_GRACE_S and not _is_locked(path):
            found.append(Removable(path, _size(path), "left by a run that was killed"))
    for path in sorted(store.root.glob("damaged/*")):
        found.append(Removable(path, _size(path), "damaged, set aside"))
    for path in artifacts(store):
        with contextlib.suppress(FileNotFoundError):
            marker = path / "COMMIT"
            idle_days = (now - (marker if marker.exists() else path).stat().st_mtime) / 86400
            if idle_days > unused_days:
                found.append(Removable(path, _size(path), f"not used for {idle_days:.0f} days"))
    return found


def remove(store: Store, items: list[Removable]) -> int:
    """Remove what `removable` listed, except artifacts that are in use right now; returns the bytes freed."""
    freed = 0
    for item in items:
        if item.path.parts[-4] == "artifacts":
            stage, key = item.path.parts[-3], item.path.name
            with store.try_lock(stage, key) as held:
                if not held:
                    continue
                grave = store.root / "tmp" / f"{key}-removed"
                grave.parent.mkdir(exist_ok=True)
                item.path.rename(grave)  # at once: no reader sees half an artifact
                shutil.rmtree(grave, ignore_errors=True)
        else:
            shutil.rmtree(item.path, ignore_errors=True)
        freed += item.num_bytes
    return freed


def known_videos(store: Store) -> list[dict[str, Any]]:
    """Every video that was run on this store: {video, state, run_dir, reason, finished}, newest first."""
    videos = []
    for path in store.root.glob("latest/*/run.json"):
        with contextlib.suppress(OSError, ValueError):
            videos.append(json.loads(path.read_text()))
    return sorted(videos, key=lambda video: str(video.get("finished")), reverse=True)


def _check_content(folder: Path, manifest: Manifest, output: str) -> None:
    module, _, name = output.partition(":")
    kind = getattr(import_module(module), name)
    files = {path: sha for path, (_, sha) in manifest.files.items() if path.startswith("files/")}
    if encode(decode(read_encoded(folder), kind), kind).digest(files) != manifest.digest:
        raise DamageError("its decoded content does not have its content digest")


def _size(path: Path) -> int:
    total = 0
    for folder, _, names in os.walk(path):
        for name in names:
            with contextlib.suppress(OSError):
                total += (Path(folder) / name).stat().st_size
    return total


def _is_locked(folder: Path) -> bool:
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    else:
        return False
    finally:
        os.close(descriptor)
