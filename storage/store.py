"""The content-addressed store on a local disk.

    artifacts/<stage>/<ab>/<key>/   finished artifacts (see `humanmm.storage.artifact`), put there by ONE rename
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
import json
import logging
import os
import shutil
import time
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import TypeVar

from humanmm.errors import StoreError
from humanmm.storage.artifact import DamageError, Manifest, check_files, read_encoded, read_manifest, write_artifact
from humanmm.storage.codec import Encoded, decode, encode
from humanmm.storage.files import sync_to_disk
from humanmm.storage.recipe import Recipe
from humanmm.storage.refs import Ref, artifact_uri

log = logging.getLogger(__name__)
T = TypeVar("T")

TMP_GRACE_S = 60.0
"""A folder in tmp/ younger than this is never swept: its writer may not hold its lock yet."""


def default_store() -> Path:
    """$HUMANMM_STORE, else ~/.cache/humanmm/store."""
    return Path(os.environ.get("HUMANMM_STORE") or cache_folder() / "store")


def cache_folder() -> Path:
    """$HUMANMM_CACHE, else ~/.cache/humanmm: what may be deleted at any time when nothing runs."""
    return Path(os.environ.get("HUMANMM_CACHE") or Path.home() / ".cache" / "humanmm")


class Store:
    """One store. With `read_only` nothing at all is written: no folder, no record, damage stays where it is."""

    def __init__(self, root: Path, *, read_only: bool = False) -> None:
        if "://" in str(root) or ":/" in str(root):
            raise StoreError(f"{root} is not a folder; this version keeps its store on a local disk")
        self.root = root.expanduser().absolute()
        self.read_only = read_only
        self._checked: dict[tuple[str, str], Manifest] = {}
        self._damage: dict[tuple[str, str], str] = {}

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

    def read(self, ref: Ref, output: type[T]) -> T:
        """The decoded result. StoreError if it is gone or damaged."""
        if self.find(ref.stage, ref.key) is None:
            reason = self.damage(ref.stage, ref.key) or "it is gone"
            raise StoreError(f"the artifact of {ref.stage} ({ref.unit}) cannot be read: {reason}; run again")
        try:
            return decode(read_encoded(self.root / ref.uri), output)
        except (OSError, ValueError, KeyError, TypeError) as error:
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
        target = self.root / artifact_uri(recipe.stage, recipe.key)
        created = time.strftime("%Y-%m-%dT%H:%M:%S%z")
        with self._writing(f"write the artifact of {recipe.stage}"):
            manifest = write_artifact(
                folder, encoded, recipe, unit=unit, seconds=seconds, created=created, version=version
            )
            target.parent.mkdir(parents=True, exist_ok=True)
            older = self.find(recipe.stage, recipe.key)
            if older is not None and older.digest == manifest.digest:
                return older
            if target.exists():
                target.rename(self.root / "tmp" / f"{uuid.uuid4().hex}-replaced")
            folder.rename(target)
            sync_to_disk(target.parent)
        self._checked[recipe.stage, recipe.key] = manifest
        self._damage.pop((recipe.stage, recipe.key), None)
        return manifest

    # ---- what was there before

    def remember(self, video: str, unit: str, manifest: Manifest) -> None:
        """Note the recipe of a unit, for `last_recipe`."""
        path = self._record_path(video, manifest.recipe.stage, unit)
        text = json.dumps({"recipe": manifest.recipe.to_json(), "key": manifest.recipe.key, "digest": manifest.digest})
        with contextlib.suppress(OSError):
            if path.read_text() == text:
                return
        self.write_text(path, text)

    def last_recipe(self, video: str, stage: str, unit: str) -> Recipe | None:
        """The recipe with which a unit of this video was last computed or found."""
        try:
            return Recipe.from_json(json.loads(self._record_path(video, stage, unit).read_text())["recipe"])
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def last_digest(self, video: str, stage: str, unit: str) -> str | None:
        """Content digest of what a unit of this video last gave."""
        try:
            return str(json.loads(self._record_path(video, stage, unit).read_text())["digest"])
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def remember_run(self, video: str, state: str, *, run_dir: Path | None, reason: str = "") -> None:
        """Note how the last run on a video ended, for `humanmm status`."""
        entry = {
            "video": video,
            "state": state,
            "run_dir": os.fspath(run_dir.absolute()) if run_dir else None,
            "reason": reason,
            "finished": time.strftime("%Y-%m-%dT%H:%M:%S%z"),
        }
        self.write_text(self.root / "latest" / video[:32] / "run.json", json.dumps(entry))

    def write_text(self, path: Path, text: str) -> None:
        """Replace a small file at once; nothing happens in a read-only store."""
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

    def _record_path(self, video: str, stage: str, unit: str) -> Path:
        return self.root / "latest" / video[:32] / stage / f"{unit}.json"

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
