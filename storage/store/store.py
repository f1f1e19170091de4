"""The content-addressed store on a local disk.

    artifacts/<stage>/<ab>/<key>/   finished artifacts (see `humanmm.storage.store.artifact`), put there by ONE rename
    tmp/                            artifacts being written; what a killed process left is swept
    locks/                          one flock per key: a killed holder frees it at once
    damaged/                        artifacts set aside because they were not what their manifest says
    latest/<video>/<stage>/         the last recipe per unit, so that a recompute can say what changed
    videos/                         content hashes of videos by path, size, time and inode

Nothing in it names the store's own path, so it can be moved.
"""

import contextlib
import errno
import fcntl
import functools
import json
import logging
import os
import shutil
import time
import uuid
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal, TypeVar

from humanmm.errors import StoreError
from humanmm.storage.store.artifact import (
    DamageError,
    Manifest,
    check_files,
    read_encoded,
    read_manifest,
    write_artifact,
)
from humanmm.storage.store.codec import Encoded, decode, encode
from humanmm.storage.store.files import sync_to_disk
from humanmm.storage.store.recipe import Recipe
from humanmm.storage.store.refs import Ref, artifact_uri

log = logging.getLogger(__name__)
T = TypeVar("T")

_UNREADABLE = (DamageError, OSError, ValueError, KeyError, TypeError)
TMP_GRACE_S = 60.0
"""A folder in tmp/ younger than this is never swept: its writer may not hold its lock yet."""


def default_store() -> Path:
    """$HUMANMM_STORE, else ~/.cache/humanmm/store."""
    return Path(os.environ.get("HUMANMM_STORE") or cache_folder() / "store")


def cache_folder() -> Path:
    """$HUMANMM_CACHE, else ~/.cache/humanmm: what may be deleted at any time when nothing runs."""
    return Path(os.environ.get("HUMANMM_CACHE") or Path.home() / ".cache" / "humanmm")


Kind = Literal["artifact", "damaged", "unfinished", "copy"]


@dataclass(frozen=True)
class Entry:
    """Something that lies in a store, for its upkeep."""

    kind: Kind
    name: str
    """Where, relative to the store's root."""
    idle_s: float
    """Since it was last used."""
    measure: Callable[[], int]
    """Tells its bytes."""
    stage: str = ""
    key: str = ""
    busy: bool = False
    """Whether somebody is writing it now."""


@dataclass(frozen=True)
class RunNote:
    """How the last run on a video ended, for `status`, for batches, and for what `gc` keeps."""

    video: str
    """Its sha256."""
    state: str
    """done, partial or failed."""
    path: str = ""
    run_dir: str | None = None
    host: str = ""
    """Where the run folder is."""
    reason: str = ""
    recipe: str = ""
    """Digest of code, weights, libraries and settings, if it is done."""
    artifacts: tuple[str, ...] = ()
    """Everything that it found or made, by URI."""
    finished: str = ""


class Store:
    """One store. With `read_only` nothing at all is written: no folder, no record, damage stays where it is.

    This one is on a local disk; `humanmm.storage.store.bucket_store` keeps what this one keeps in an S3 bucket.
    """

    def __init__(self, root: Path, *, read_only: bool = False) -> None:
        if ":/" in str(root):
            raise StoreError(f"{root} is not a folder on a local disk")
        self.root = root.expanduser().absolute()
        self.read_only = read_only
        self._checked: dict[tuple[str, str], Manifest] = {}
        self._damage: dict[tuple[str, str], str] = {}

    def __reduce__(self) -> tuple[Callable[[], "Store"], tuple[()]]:
        """Another process opens it again, and checks itself what it reads."""
        from humanmm.storage.store.open import open_store

        return functools.partial(open_store, self.place, read_only=self.read_only), ()

    @property
    def place(self) -> str:
        """What `humanmm.storage.store.open.open_store` finds it by."""
        return os.fspath(self.root)

    # ---- finding and reading

    def find(self, stage: str, key: str) -> Manifest | None:
        """The manifest of a whole, undamaged artifact, every byte checked once per process; None if there is none.

        A damaged one is set aside; `damage` then tells why.
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
                os.utime(folder / "COMMIT")  # gc goes by last use
        self._checked[stage, key] = manifest
        return manifest

    def damage(self, stage: str, key: str) -> str | None:
        """Why an artifact was found damaged in this process, if it was."""
        return self._damage.get((stage, key))

    def manifest(self, ref: Ref) -> Manifest:
        """The manifest of what a reference names. StoreError if it is gone or damaged."""
        manifest = self.find(ref.stage, ref.key)
        if manifest is None:
            reason = self.damage(ref.stage, ref.key) or "it is gone"
            raise StoreError(f"the artifact of {ref.stage} ({ref.unit}) cannot be read: {reason}; run again")
        return manifest

    def read(self, ref: Ref, output: type[T]) -> T:
        """The decoded result. StoreError if it is gone or damaged."""
        with contextlib.suppress(*_UNREADABLE):
            return decode(read_encoded(self.root / ref.uri, self.manifest(ref)), output)
        self._checked.pop((ref.stage, ref.key), None)  # damaged or replaced since it was checked: `manifest` tells
        manifest = self.manifest(ref)
        try:
            return decode(read_encoded(self.root / ref.uri, manifest), output)
        except _UNREADABLE as error:
            self._checked.pop((ref.stage, ref.key), None)
            self.set_aside(ref.stage, ref.key, str(error))
            raise StoreError(f"the artifact of {ref.stage} ({ref.unit}) is damaged: {error}; run again") from error

    def files_of(self, ref: Ref) -> Path:
        """The folder of the files that the stage wrote itself."""
        return self.root / ref.uri / "files"

    # ---- writing

    @contextlib.contextmanager
    def lock(self, stage: str, key: str) -> Iterator[None]:
        """Hold the only right to write one key, over all processes of this host; a killed holder frees it."""
        path = self.root / "locks" / f"{stage}-{key}"
        with self._writing("lock"):
            path.parent.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                log.info("%s is being computed by another process; waiting for it", stage)
                fcntl.flock(descriptor, fcntl.LOCK_EX)
            yield
        finally:
            os.close(descriptor)

    @contextlib.contextmanager
    def try_lock(self, stage: str, key: str) -> Iterator[bool]:
        """As `lock`, but says False at once when somebody holds it."""
        path = self.root / "locks" / f"{stage}-{key}"
        with self._writing("lock"):
            path.parent.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            yield True
        except BlockingIOError:
            yield False
        finally:
            os.close(descriptor)

    def is_locked(self, stage: str, key: str) -> bool:
        """Whether somebody holds the right to write one key."""
        with self.try_lock(stage, key) as free:
            return not free

    @contextlib.contextmanager
    def new_folder(self) -> Iterator[Path]:
        """A folder in tmp/ for one artifact in the making, with an empty files/; gone afterwards unless committed."""
        folder = self.root / "tmp" / uuid.uuid4().hex
        with self._writing("begin an artifact"):
            (folder / "files").mkdir(parents=True)
        descriptor = os.open(folder, os.O_RDONLY)
        fcntl.flock(descriptor, fcntl.LOCK_EX)  # says that its writer is alive, see `sweep`
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)
            os.close(descriptor)

    def commit(
        self, folder: Path, value: object, output: type, recipe: Recipe, *, unit: str, seconds: float, version: str
    ) -> Manifest:
        """Write a result beside the files in `folder` and make it visible at once. The caller holds the key's lock.

        An artifact that is there already (a forced recompute) stays if the content is the same, else gives way.
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
        """Make a complete artifact visible at once; what then stands under its key."""
        self._put_in_place(folder, self.root / manifest.ref.uri)
        return manifest

    def _put_in_place(self, folder: Path, target: Path) -> None:
        target.parent.mkdir(parents=True, exist_ok=True)
        if target.exists():
            target.rename(self.root / "tmp" / f"{uuid.uuid4().hex}-replaced")
        folder.rename(target)
        sync_to_disk(target.parent)

    # ---- what was there before

    def remember(self, video: str, unit: str, manifest: Manifest) -> None:
        """Note the recipe of a unit, for `last_recipe`."""
        name = _record_name(video, manifest.recipe.stage, unit)
        text = json.dumps({"recipe": manifest.recipe.to_json(), "key": manifest.recipe.key, "digest": manifest.digest})
        if self.noted(name) != text:
            self.note(name, text)

    def last_recipe(self, video: str, stage: str, unit: str) -> Recipe | None:
        """The recipe with which a unit of this video was last computed or found."""
        try:
            return Recipe.from_json(json.loads(self.noted(_record_name(video, stage, unit)) or "")["recipe"])
        except (ValueError, KeyError, TypeError):
            return None

    def last_digest(self, video: str, stage: str, unit: str) -> str | None:
        """Content digest of what a unit of this video last gave."""
        try:
            return str(json.loads(self.noted(_record_name(video, stage, unit)) or "")["digest"])
        except (ValueError, KeyError, TypeError):
            return None

    def note_run(self, note: RunNote) -> None:
        """Note how the last run on a video ended."""
        self.note(_run_name(note.video), json.dumps(asdict(note)))

    def noted_run(self, name: str) -> RunNote | None:
        """What a name of `runs_noted` says; None if it is gone or unreadable."""
        with contextlib.suppress(ValueError, TypeError):
            known = json.loads(self.noted(name) or "")
            return RunNote(**{**known, "artifacts": tuple(known.get("artifacts", ()))})
        return None

    def last_run(self, video: str) -> RunNote | None:
        """How the last run on a video ended; None if there was none."""
        return self.noted_run(_run_name(video))

    def note(self, name: str, text: str) -> None:
        """Write a small record of the store, for all who use it; `name` is relative to its root."""
        self.write_text(self.root / name, text)

    def noted(self, name: str) -> str | None:
        """A record; None if there is none."""
        try:
            return (self.root / name).read_text()
        except (OSError, ValueError):
            return None

    def runs_noted(self) -> Iterator[str]:
        """Names of the records of `note_run`."""
        for path in self.root.glob("latest/*/run.json"):
            yield str(path.relative_to(self.root))

    def write_text(self, path: Path, text: str) -> None:
        """Replace a small file of this host at once; nothing happens in a read-only store."""
        if self.read_only:
            return
        with self._writing(f"write {path.name}"):
            path.parent.mkdir(parents=True, exist_ok=True)
            fresh = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
            try:
                fresh.write_text(text)
                fresh.replace(path)
            finally:
                fresh.unlink(missing_ok=True)

    # ---- upkeep

    def entries(self) -> Iterator[Entry]:
        """Everything that lies here: artifacts, damaged ones included, what was set aside, what is being written."""
        now = time.time()
        for path in sorted(self.root.glob("artifacts/*/??/*")):
            with contextlib.suppress(FileNotFoundError):
                yield self._entry("artifact", path, now - _last_use(path), stage=path.parts[-3], key=path.name)
        for path in self._children("damaged"):
            yield self._entry("damaged", path, 0.0)
        for path in self._children("tmp"):
            with contextlib.suppress(FileNotFoundError):
                idle_s = now - path.stat().st_mtime
                yield self._entry("unfinished", path, idle_s, busy=idle_s <= TMP_GRACE_S or _is_locked(path))

    def _entry(
        self, kind: Kind, path: Path, idle_s: float, *, stage: str = "", key: str = "", busy: bool = False
    ) -> Entry:
        name = str(path.relative_to(self.root))
        return Entry(kind, name, idle_s, lambda: _size(path), stage, key, busy)

    def idle_s(self, entry: Entry) -> float | None:
        """Seconds since an artifact was used last, as it is now; None if it is gone."""
        try:
            return time.time() - _last_use(self.root / entry.name)
        except FileNotFoundError:
            return None

    @contextlib.contextmanager
    def opened(self, stage: str, key: str) -> Iterator[Path]:
        """The folder of one artifact, unchecked, for `verify`; DamageError if there is none."""
        yield self.root / artifact_uri(stage, key)

    def drop(self, entry: Entry) -> None:
        """Remove something for good. The caller holds the key's lock if it is an artifact."""
        path = self.root / entry.name
        if entry.key:
            grave = self.root / "tmp" / f"{entry.key}-removed"
            grave.parent.mkdir(exist_ok=True)
            path.rename(grave)  # at once: no reader sees half an artifact
            path = grave
        shutil.rmtree(path, ignore_errors=True)

    # ---- faults

    def sweep(self) -> int:
        """Remove what killed writers left in tmp/; returns how many folders."""
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
        """Move a damaged artifact out of the way and note why; a read-only store only notes."""
        self._damage[stage, key] = reason
        if self.read_only:
            return
        log.warning("the artifact of %s is damaged (%s); it is set aside and computed again", stage, reason)
        place = self.root / "damaged" / f"{stage}-{key[:16]}-{uuid.uuid4().hex[:8]}"
        with contextlib.suppress(FileNotFoundError), self._writing("set a damaged artifact aside"):
            place.parent.mkdir(parents=True, exist_ok=True)
            (self.root / artifact_uri(stage, key)).rename(place)

    @contextlib.contextmanager
    def _writing(self, what: str) -> Iterator[None]:
        try:
            yield
        except FileNotFoundError:
            raise
        except OSError as error:
            raise StoreError(explain_os_error(error, f"cannot {what} in the store {self.root}")) from error


def _record_name(video: str, stage: str, unit: str) -> str:
    return f"latest/{video[:32]}/{stage}/{unit}.json"


def _run_name(video: str) -> str:
    return f"latest/{video[:32]}/run.json"


def _last_use(artifact: Path) -> float:
    marker = artifact / "COMMIT"
    return (marker if marker.exists() else artifact).stat().st_mtime


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


def explain_os_error(error: OSError, what: str) -> str:
    """One sentence for a file-system fault: what failed, why, what to do."""
    advice = {
        errno.ENOSPC: "the disk is full; free some space or name another store with --store",
        errno.EDQUOT: "the disk quota is used up; free some space or name another store with --store",
        errno.EFBIG: "the file would grow past this process's limit (ulimit -f)",
        errno.EACCES: "permission denied; name a folder that you may write with --store",
        errno.EPERM: "permission denied; name a folder that you may write with --store",
        errno.EROFS: "the disk is read-only; name another store with --store",
        errno.ENOTDIR: "a part of the path is a file; name another folder",
        errno.EEXIST: "a file of that name is in the way; name another folder",
    }
    return f"{what}: {advice.get(error.errno or 0, error.strerror or str(error))}"
