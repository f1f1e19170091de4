"""The store in an S3 bucket, shared by many hosts.

    artifacts/<stage>/<ab>/<key>/<manifest>.tar   an artifact's folder in one object, named by its manifest's sha256
    artifacts/<stage>/<ab>/<key>/COMMIT           names that object; its conditional put makes the artifact exist
    locks/<stage>-<key>                           leases (`humanmm.storage.store.locks`)
    damaged/                                      artifacts set aside
    latest/                                       the same records as on a local disk

A bucket has no rename and no flock. Artifacts are written and read in a folder of this host, a store of copies on its
local disk, which may be deleted whenever nothing runs.
"""

import contextlib
import functools
import hashlib
import itertools
import logging
import shutil
import tarfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path, PurePosixPath

from humanmm.errors import StoreError
from humanmm.storage.store.artifact import DamageError, Manifest, artifact_uri, check_files, read_manifest
from humanmm.storage.store.bucket import Bucket, Object
from humanmm.storage.store.locks import FileLock, Lease
from humanmm.storage.store.store import Entry, Store, cache_folder

log = logging.getLogger(__name__)

TOUCH_S = 86400.0
"""A commit marker older than this is written again when its artifact is used: gc knows the last use to a day."""
UPLOAD_GRACE_S = 86400.0
"""An object younger than this may still get its commit marker."""


class BucketStore(Store):
    """One store in a bucket. With `read_only` nothing in the bucket is written; this host still keeps copies."""

    def __init__(self, url: str, *, read_only: bool = False) -> None:
        self.bucket = Bucket(url)
        name = hashlib.sha256(self.bucket.url.encode()).hexdigest()[:16]
        super().__init__(cache_folder() / "buckets" / name, read_only=read_only)
        self._markers: dict[str, bytes] = {}

    def __reduce__(self) -> tuple[Callable[[], "BucketStore"], tuple[()]]:
        return functools.partial(BucketStore, self.bucket.url, read_only=self.read_only), ()

    @property
    def location(self) -> str:
        return self.bucket.url

    # ---- finding and reading

    def find(self, stage: str, key: str) -> Manifest | None:
        uri = artifact_uri(stage, key)
        found = self.bucket.read(f"{uri}/COMMIT")
        if found is None:
            return None
        marker, state = found
        if state.age_s > TOUCH_S and not self.read_only:
            self.bucket.replace(f"{uri}/COMMIT", marker, state.tag)
        if self._markers.get(uri) != marker:  # another process may have replaced it, and our copy
            self._checked.pop((stage, key), None)
        for _ in range(2):  # a damaged copy is made again from what is in the bucket
            try:
                self._copy(uri, marker)
            except DamageError as error:
                self.set_aside(stage, key, str(error))
                return None
            manifest = super().find(stage, key)
            if manifest is not None:
                self._markers[uri] = marker
                self._damage.pop((stage, key), None)
                return manifest
            if self.bucket.read(f"{uri}/COMMIT") is None:
                break
        return None

    def _copy(self, uri: str, marker: bytes) -> None:
        """Make this host's copy the one that a commit marker names. DamageError if that is impossible."""
        target = self.root / uri
        if _marker_of(target) == marker:
            return
        path = self.root / "locks" / f"copy-{uri.replace('/', '-')}"
        lock = FileLock(path, waiting=f"another process fetches {uri}; waiting for it")
        with self._writing("copy an artifact"), lock.held():
            if _marker_of(target) == marker:
                return
            with self.new_folder() as staging:
                self._unpack(uri, marker, staging / "copy")
                self._put_in_place(staging / "copy", target)

    def _unpack(self, uri: str, marker: bytes, folder: Path) -> None:
        tar = folder.with_suffix(".tar")
        if not self.bucket.download(_tar_name(uri, marker), tar):
            raise DamageError("the object that its COMMIT names is missing")
        try:
            with tarfile.open(tar, "r:") as archive:
                extract(archive, folder)
        except tarfile.TarError as error:
            raise DamageError(f"its object cannot be unpacked: {error}") from error
        tar.unlink()
        if _marker_of(folder) != marker:
            raise DamageError("COMMIT in its object is not the one beside it")

    # ---- writing

    def _lock_of(self, stage: str, key: str) -> FileLock | Lease:
        return Lease(self.bucket, f"locks/{stage}-{key}")

    def _publish(self, folder: Path, manifest: Manifest) -> Manifest:
        uri = manifest.ref.uri
        marker = (folder / "COMMIT").read_bytes()
        before = self.bucket.read(f"{uri}/COMMIT")
        with self.new_folder() as staging:
            with tarfile.open(staging / "copy.tar", "w") as archive:
                archive.add(folder, arcname=".", filter=_without_user)
            self.bucket.upload(_tar_name(uri, marker), staging / "copy.tar")
        if before is None:
            committed = self.bucket.create(f"{uri}/COMMIT", marker)
        else:
            committed = self.bucket.replace(f"{uri}/COMMIT", marker, before[1].tag)
        if committed is None:  # another process was first (or this put was sent twice): its artifact counts
            theirs = self.find(manifest.recipe.stage, manifest.recipe.key)
            if theirs is None:
                raise StoreError(f"the artifact of {manifest.recipe.stage} was removed while it was written")
            if self._markers[uri] != marker:
                self.bucket.remove([_tar_name(uri, marker)])
            return theirs
        if before is not None:
            self.bucket.remove([_tar_name(uri, before[0])])
        self._put_in_place(folder, self.root / uri)
        return manifest

    def note(self, name: str, text: str) -> None:
        if not self.read_only:
            self.bucket.write(name, text.encode())

    def noted(self, name: str) -> str | None:
        found = self.bucket.read(name)
        return None if found is None else found[0].decode(errors="replace")

    def runs_noted(self) -> Iterator[str]:
        for found in self.bucket.list("latest"):
            if found.name.count("/") == 2 and found.name.endswith("/run.json"):
                yield found.name

    # ---- maintenance and faults

    def entries(self) -> Iterator[Entry]:
        """The entries of the bucket, then the copies on this host."""
        for uri, objects in itertools.groupby(self.bucket.list("artifacts"), lambda o: o.name.rpartition("/")[0]):
            yield _artifact_entry(uri, list(objects))
        for found in self.bucket.list("damaged"):
            yield Entry("damaged", found.name, found.age_s, lambda size=found.num_bytes: size)  # type: ignore[misc]
        for entry in super().entries():
            yield replace(entry, kind="copy") if entry.kind == "artifact" else entry

    def measure(self) -> int:
        return 0

    def idle_s(self, entry: Entry) -> float | None:
        found = self.bucket.read(f"{entry.name}/COMMIT")
        return None if found is None else found[1].age_s

    @contextlib.contextmanager
    def opened(self, stage: str, key: str) -> Iterator[Path]:
        uri = artifact_uri(stage, key)
        found = self.bucket.read(f"{uri}/COMMIT")
        if found is None:
            raise DamageError("COMMIT is missing")
        with self.new_folder() as staging:
            self._unpack(uri, found[0], staging / "copy")
            yield staging / "copy"

    def drop(self, entry: Entry) -> None:
        if (self.root / entry.name).exists():
            super().drop(entry)
        if entry.kind == "damaged":
            self.bucket.remove([entry.name])
        elif entry.stage and entry.kind != "copy":
            names = [found.name for found in self.bucket.list(entry.name)]
            self.bucket.remove(sorted(names, key=lambda name: not name.endswith("/COMMIT")))  # no longer visible first

    def set_aside(self, stage: str, key: str, reason: str) -> None:
        """Remove a damaged copy; set the artifact in the bucket aside if it is damaged too."""
        self._damage[stage, key] = reason
        uri = artifact_uri(stage, key)
        shutil.rmtree(self.root / uri, ignore_errors=True)
        try:
            with self.opened(stage, key) as folder:
                check_files(folder, read_manifest(folder))
        except (DamageError, ValueError, TypeError, KeyError):
            if self.read_only:
                return
            log.warning("the artifact of %s is damaged (%s); it is set aside and computed again", stage, reason)
            tars = [found.name for found in self.bucket.list(uri) if not found.name.endswith("/COMMIT")]
            self.bucket.remove([f"{uri}/COMMIT"])
            for name in tars:
                self.bucket.move(name, f"damaged/{stage}-{key[:16]}-{Path(name).name}")


def extract(archive: tarfile.TarFile, folder: Path) -> None:
    """Extract folders and plain files below `folder`; any other member of the archive is an error.

    (Python's own filter for this came with 3.11.4.)
    """
    for member in archive:
        name = PurePosixPath(member.name)
        if name.is_absolute() or ".." in name.parts:
            raise tarfile.TarError(f"{member.name!r} lies outside")
        target = folder / name
        data = archive.extractfile(member) if member.isfile() else None
        if data is None and not member.isdir():
            raise tarfile.TarError(f"{member.name!r} is neither a file nor a folder")
        if data is None:
            target.mkdir(parents=True, exist_ok=True)
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        with data, target.open("wb") as file:
            shutil.copyfileobj(data, file)


def _without_user(member: tarfile.TarInfo) -> tarfile.TarInfo:
    """The member without user and group, which mean nothing on another host."""
    member.uid = member.gid = 0
    member.uname = member.gname = ""
    return member


def _artifact_entry(uri: str, objects: list[Object]) -> Entry:
    """One artifact in a bucket; without its commit marker an unfinished one."""
    size = sum(found.num_bytes for found in objects)
    _, stage, _, key = uri.split("/")
    marker = next((found for found in objects if found.name.endswith("/COMMIT")), None)
    if marker is not None:
        return Entry("artifact", uri, marker.age_s, lambda: size, stage, key)
    idle_s = min(found.age_s for found in objects)
    return Entry("unfinished", uri, idle_s, lambda: size, stage, key, busy=idle_s <= UPLOAD_GRACE_S)


def _tar_name(uri: str, marker: bytes) -> str:
    name = marker.decode(errors="replace").strip()
    return f"{uri}/{name if name.isalnum() else 'unreadable'}.tar"


def _marker_of(folder: Path) -> bytes | None:
    try:
        return (folder / "COMMIT").read_bytes()
    except FileNotFoundError:
        return None
