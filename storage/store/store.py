"""The content-addressed store on a local disk.

    artifacts/<stage>/<ab>/<key>/   finished artifacts (`humanmm.storage.store.artifact`), moved there by ONE rename
    tmp/                            artifacts being written; `sweep` removes those of killed processes
    locks/                          one flock per key (`humanmm.storage.store.locks`)
    damaged/                        artifacts set aside because they differed from their manifest
    latest/<video>/                 records of the last run (`humanmm.storage.store.video_records`)
    videos/                         content hashes of videos by path, size, time and inode

No file in it names the store's own path, so it can be moved.
"""

import contextlib
import fcntl
import functools
import logging
import os
import shutil
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeVar

from humanmm.errors import StoreError
from humanmm.machine import expanded
from humanmm.storage.store.artifact import (
    DamageError,
    Manifest,
    Ref,
    artifact_uri,
    check_files,
    read_encoded,
    read_manifest,
    write_artifact,
)
from humanmm.storage.store.codec import Encoded, decode, encode
from humanmm.storage.store.files import replace_file, store_errors, sync_to_disk
from humanmm.storage.store.locks import FileLock, Lease, is_folder_locked
from humanmm.storage.store.recipe import Recipe
from humanmm.storage.store.video_records import VideoRecords

log = logging.getLogger(__name__)
T = TypeVar("T")

_UNREADABLE = (DamageError, OSError, ValueError, KeyError, TypeError)
TMP_GRACE_S = 60.0
"""A folder in tmp/ younger than this is never swept: its writer may not hold its lock yet."""


def default_store() -> Path:
    """$HUMANMM_STORE, else ~/.cache/humanmm/store."""
    return Path(os.environ.get("HUMANMM_STORE") or cache_folder() / "store")


def cache_folder() -> Path:
    """$HUMANMM_CACHE, else ~/.cache/humanmm; it may be deleted whenever nothing runs."""
    return Path(os.environ.get("HUMANMM_CACHE") or Path.home() / ".cache" / "humanmm")


Kind = Literal["artifact", "damaged", "unfinished", "copy"]


@dataclass(frozen=True)
class Entry:
    """One artifact, leftover or copy in a store, for its maintenance."""

    kind: Kind
    name: str
    """Its path relative to the store's root."""
    idle_s: float
    """Seconds since it was last used."""
    measure: Callable[[], int]
    """Its size in bytes."""
    stage: str = ""
    key: str = ""
    busy: bool = False
    """Whether a process is writing it now."""


class Store(VideoRecords):
    """One store on a local disk; `humanmm.storage.store.bucket_store` has the one in an S3 bucket.

    With `read_only` nothing at all is written: no folder, no record, damaged artifacts stay where they are.
    """

    def __init__(self, root: Path, *, read_only: bool = False) -> None:
        if ":/" in str(root):
            raise StoreError(f"{root} is not a folder on a local disk")
        self.root = expanded(root).absolute()
        self.read_only = read_only
        self._checked: dict[tuple[str, str], Manifest] = {}
        self._damage: dict[tuple[str, str], str] = {}

    def __reduce__(self) -> tuple[Callable[[], "Store"], tuple[()]]:
        """Another process opens it again, and checks itself what it reads."""
        return functools.partial(Store, self.root, read_only=self.read_only), ()

    @property
    def location(self) -> str:
        """The folder, or the URL of the bucket: `humanmm.storage.store.open.open_store` opens it."""
        return os.fspath(self.root)

    # ---- finding and reading

    def find(self, stage: str, key: str) -> Manifest | None:
        """The manifest of a whole, undamaged artifact, every byte checked once per process; None if there is none.

        A damaged one is set aside; `damage` then says why.
        """
        known = self._checked.get((stage, key))
        folder = self.root / artifact_uri(stage, key)
        if known is not None and (folder / "COMMIT").is_file():
            return known
        if not folder.is_dir():
            return None
        try:
            manifest = read_manifest(folder)
            check_files(folder, manifest)
        except (DamageError, ValueError, TypeError, KeyError) as error:
            self.set_aside(stage, key, str(error))
            return None
        if not self.read_only:
            with contextlib.suppress(OSError):
                os.utime(folder / "COMMIT")  # its time of last use, for gc
        self._checked[stage, key] = manifest
        return manifest

    def damage(self, stage: str, key: str) -> str | None:
        """Why an artifact was found damaged in this process, if it was."""
        return self._damage.get((stage, key))

    def manifest(self, ref: Ref) -> Manifest:
        """The manifest of the artifact that a reference names. StoreError if it is gone or damaged."""
        manifest = self.find(ref.stage, ref.key)
        if manifest is None:
            reason = self.damage(ref.stage, ref.key) or "it is gone"
            raise StoreError(f"the artifact of {ref.stage} ({ref.unit}) cannot be read: {reason}; run again")
        return manifest

    def read(self, ref: Ref, output: type[T]) -> T:
        """The decoded result. StoreError if it is gone or damaged."""
        with contextlib.suppress(*_UNREADABLE):
            return decode(read_encoded(self.root / ref.uri, self.manifest(ref)), output)
        self._checked.pop((ref.stage, ref.key), None)  # damaged or replaced since it was checked
        manifest = self.manifest(ref)
        try:
            return decode(read_encoded(self.root / ref.uri, manifest), output)
        except _UNREADABLE as error:
            self._checked.pop((ref.stage, ref.key), None)
            self.set_aside(ref.stage, ref.key, str(error))
            raise StoreError(f"the artifact of {ref.stage} ({ref.unit}) is damaged: {error}; run again") from error

    def is_current(self, ref: Ref) -> bool:
        """Whether what is now under a reference's key is the content that it names: another process that was told to
        compute it again may have put another one there."""
        with contextlib.suppress(*_UNREADABLE):
            return read_manifest(self.root / ref.uri).digest == ref.digest
        return False

    def files_of(self, ref: Ref) -> Path:
        """The folder of the files that the stage wrote itself."""
        return self.root / ref.uri / "files"

    # ---- writing

    def lock(self, stage: str, key: str) -> AbstractContextManager[None]:
        """Hold the only right to write one key; waits for another holder, a killed one frees it."""
        return self._lock_of(stage, key).held()

    def try_lock(self, stage: str, key: str) -> AbstractContextManager[bool]:
        """As `lock`, but yields False at once when another process holds it."""
        return self._lock_of(stage, key).tried()

    def _lock_of(self, stage: str, key: str) -> FileLock | Lease:
        waiting = f"{stage} is being computed by another process; waiting for it"
        return FileLock(self._lock_file(stage, key), waiting=waiting)

    def _lock_file(self, stage: str, key: str) -> Path:
        return self.root / "locks" / f"{stage}-{key}"

    @contextlib.contextmanager
    def new_folder(self) -> Iterator[Path]:
        """A staging folder in tmp/ for one artifact, with an empty files/; removed afterwards unless committed."""
        folder = self.root / "tmp" / uuid.uuid4().hex
        with self._writing("begin an artifact"):
            (folder / "files").mkdir(parents=True)
        descriptor = os.open(folder, os.O_RDONLY)
        fcntl.flock(descriptor, fcntl.LOCK_EX)  # its writer is alive, see `sweep`
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)
            os.close(descriptor)

    def commit(
        self, folder: Path, value: object, output: type, recipe: Recipe, *, unit: str, seconds: float, version: str
    ) -> Manifest:
        """Write a result beside the files in `folder` and make it visible at once. The caller holds the key's lock.

        An artifact that is there already (a forced recompute) stays if its content is equal, else it is replaced.
        """
        encoded: Encoded = encode(value, output)
        created = time.strftime("%Y-%m-%dT%H:%M:%S%z")
        with self._writing(f"write the artifact of {recipe.stage}"):
            manifest = write_artifact(
                folder, encoded, recipe, unit=unit, seconds=seconds, created=created, version=version
            )
            older = self.find(recipe.stage, recipe.key)
            if older is not None and older.digest == manifest.digest:
                return older
            kept = self._publish(folder, manifest)
        self._checked[recipe.stage, recipe.key] = kept
        self._damage.pop((recipe.stage, recipe.key), None)
        return kept

    def _publish(self, folder: Path, manifest: Manifest) -> Manifest:
        """Make a complete artifact visible at once; returns the manifest that is then under its key."""
        self._put_in_place(folder, self.root / manifest.ref.uri)
        return manifest

    def _put_in_place(self, folder: Path, target: Path) -> None:
        target.parent.mkdir(parents=True, exist_ok=True)
        if target.exists():
            target.rename(self.root / "tmp" / f"{uuid.uuid4().hex}-replaced")
        folder.rename(target)
        sync_to_disk(target.parent)

    # ---- records

    def note(self, name: str, text: str) -> None:
        self.write_text(self.root / name, text)

    def noted(self, name: str) -> str | None:
        try:
            return (self.root / name).read_text()
        except (OSError, ValueError):
            return None

    def runs_noted(self) -> Iterator[str]:
        for path in self.root.glob("latest/*/run.json"):
            yield str(path.relative_to(self.root))

    def write_text(self, path: Path, text: str) -> None:
        """Replace a small file of this host at once; nothing happens in a read-only store."""
        if self.read_only:
            return
        with self._writing(f"write {path.name}", missing=True):
            replace_file(path, lambda fresh: _write(fresh, text))

    # ---- maintenance

    def entries(self) -> Iterator[Entry]:
        """All artifacts, damaged ones included, all that were set aside, and all that are being written."""
        now = time.time()
        for path in sorted(self.root.glob("artifacts/*/??/*")):
            with contextlib.suppress(FileNotFoundError):
                yield self._entry("artifact", path, now - _last_use(path), stage=path.parts[-3], key=path.name)
        for path in self._children("damaged"):
            yield self._entry("damaged", path, 0.0)
        for path in self._children("tmp"):
            with contextlib.suppress(FileNotFoundError):
                idle_s = now - path.stat().st_mtime
                yield self._entry("unfinished", path, idle_s, busy=idle_s <= TMP_GRACE_S or is_folder_locked(path))

    def measure(self) -> int:
        """Bytes of the disk that the store takes, with its records and batches; 0 where it lies on no disk."""
        return _size(self.root)

    def _entry(
        self, kind: Kind, path: Path, idle_s: float, *, stage: str = "", key: str = "", busy: bool = False
    ) -> Entry:
        name = str(path.relative_to(self.root))
        return Entry(kind, name, idle_s, lambda: _size(path), stage, key, busy)

    def idle_s(self, entry: Entry) -> float | None:
        """Seconds from the last use of an artifact until now; None if it is gone."""
        try:
            return time.time() - _last_use(self.root / entry.name)
        except FileNotFoundError:
            return None

    @contextlib.contextmanager
    def opened(self, stage: str, key: str) -> Iterator[Path]:
        """The folder of one artifact, unchecked, for `verify`; DamageError if there is none."""
        yield self.root / artifact_uri(stage, key)

    def drop(self, entry: Entry) -> None:
        """Remove an entry. The caller holds the key's lock if it is an artifact."""
        path = self.root / entry.name
        if entry.key:
            trash = self.root / "tmp" / f"{uuid.uuid4().hex}-removed"  # that of a killed `gc` may still be there
            trash.parent.mkdir(exist_ok=True)
            path.rename(trash)  # at once: no reader sees half an artifact
            path = trash
        shutil.rmtree(path, ignore_errors=True)
        if entry.key:
            self._lock_file(entry.stage, entry.key).unlink(missing_ok=True)  # last: then another process may hold it

    # ---- faults

    def sweep(self) -> int:
        """Remove the folders of killed writers from tmp/; returns how many."""
        removed = 0
        for folder in self._children("tmp"):
            with contextlib.suppress(OSError):
                descriptor = os.open(folder, os.O_RDONLY)
                try:
                    if time.time() - folder.stat().st_mtime < TMP_GRACE_S:
                        continue
                    fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    shutil.rmtree(folder)
                    removed += 1
                finally:
                    os.close(descriptor)
        return removed

    def _children(self, name: str) -> list[Path]:
        folder = self.root / name
        return sorted(folder.iterdir()) if folder.is_dir() else []

    def set_aside(self, stage: str, key: str, reason: str) -> None:
        """Move a damaged artifact to damaged/ and keep the reason; a read-only store only keeps the reason."""
        self._damage[stage, key] = reason
        if self.read_only:
            return
        log.warning("the artifact of %s is damaged (%s); it is set aside and computed again", stage, reason)
        target = self.root / "damaged" / f"{stage}-{key[:16]}-{uuid.uuid4().hex[:8]}"
        with contextlib.suppress(FileNotFoundError), self._writing("set a damaged artifact aside"):
            target.parent.mkdir(parents=True, exist_ok=True)
            (self.root / artifact_uri(stage, key)).rename(target)

    def _writing(self, what: str, *, missing: bool = False) -> AbstractContextManager[None]:
        return store_errors(f"cannot {what} in the store {self.root}", missing=missing)


def _write(path: Path, text: str) -> None:
    path.write_text(text)


def _last_use(artifact: Path) -> float:
    marker = artifact / "COMMIT"
    return (marker if marker.exists() else artifact).stat().st_mtime


def _size(path: Path) -> int:
    """Bytes of the disk that a folder takes, in whole blocks and with its folders, as du(1) counts them: an artifact is
    a dozen files of less than a block. Where the file system counts no blocks, the lengths of files stand for them."""
    total = 0
    for folder, _, names in os.walk(path):
        for name in ("", *names):
            with contextlib.suppress(OSError):
                status = (Path(folder) / name).lstat()
                total += status.st_blocks * 512 or status.st_size
    return total
