"""The content hash of a video, computed once and cached in the store by path and state of the file.

A stage reads the file for as long as it runs, and its key names the content by its hash: whatever is computed while the
file changes must not be kept. The time of the last change of an inode (ctime) is what no program can set back.
"""

import contextlib
import hashlib
import json
import os
import stat
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from io import BufferedReader
from pathlib import Path
from typing import Any, BinaryIO, cast

from humanmm.errors import VideoError
from humanmm.machine import expanded
from humanmm.storage.store.store import Store

_SAMPLES, _SAMPLE_BYTES = 16, 4096


@dataclass(frozen=True)
class FileState:
    """What changes when a file is written to, truncated or replaced."""

    size: int
    mtime_ns: int
    ctime_ns: int
    inode: int
    sample: str
    """Hash of 16 pieces of 4 kB, from the first to the last: not every network file system keeps honest times."""


@dataclass(frozen=True)
class VideoIdentity:
    """A file and its state when its content was hashed; None if only the hash is known."""

    path: Path
    sha256: str
    state: FileState | None

    def open(self) -> BinaryIO:
        """The file's bytes; an error if it is no longer the file that was hashed."""
        file = open_video_file(self.path)
        if _state_of(file) != self.state:
            file.close()
            raise VideoError(
                f"{shown(self.path)} changed while it was read, and nothing that was computed of it meanwhile is kept; "
                "run again when no other program writes to it"
            )
        return file

    @contextlib.contextmanager
    def unchanged(self) -> Iterator[None]:
        """Raise VideoError after the block, also in place of its own error, if the file changed since it was hashed."""
        try:
            yield
        except Exception:
            self.open().close()
            raise
        self.open().close()


def identify(path: Path, store: Store) -> VideoIdentity:
    """The content hash of a video. VideoError unless it is a readable, non-empty file that does not change."""
    path = expanded(path).absolute()
    with open_video_file(path) as file:
        state = _state_of(file)
        known = known_content(path, store)
        if known == {**asdict(state), "sha256": known.get("sha256")}:
            return VideoIdentity(path, str(known["sha256"]), state)
        file.seek(0)
        identity = VideoIdentity(path, hashlib.file_digest(cast(BufferedReader, file), "sha256").hexdigest(), state)
    identity.open().close()
    store.write_text(_record(path, store), json.dumps({**asdict(state), "sha256": identity.sha256}))
    return identity


def _state_of(file: BinaryIO) -> FileState:
    status = os.fstat(file.fileno())
    starts = {max(status.st_size - _SAMPLE_BYTES, 0) * i // (_SAMPLES - 1) for i in range(_SAMPLES)}
    sample = hashlib.sha256()
    for start in sorted(starts):
        sample.update(os.pread(file.fileno(), _SAMPLE_BYTES, start))
    return FileState(status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino, sample.hexdigest())


def known_content(path: Path, store: Store) -> dict[str, Any]:
    """The cached sha256 of a file and the fields of its state; empty if this machine never hashed it."""
    try:
        known: dict[str, Any] = json.loads(_record(path, store).read_text())
    except (OSError, ValueError):
        return {}
    return known


def _record(path: Path, store: Store) -> Path:
    return store.root / "videos" / f"{hashlib.sha256(os.fsencode(path)).hexdigest()}.json"


def open_video_file(path: Path) -> BinaryIO:
    """Open a regular, non-empty file; a clear VideoError otherwise. Never blocks on a pipe or a device."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    except FileNotFoundError:
        raise VideoError(f"no such video: {shown(path)}") from None
    except OSError as error:
        raise VideoError(f"cannot read {shown(path)}: {error.strerror}") from None
    status = os.fstat(descriptor)
    problem = None
    if stat.S_ISDIR(status.st_mode):
        problem = "is a folder, not a video; name one file"
    elif not stat.S_ISREG(status.st_mode):
        problem = "is not a regular file; save it as a file first"
    elif status.st_size == 0:
        problem = "is empty (0 bytes)"
    if problem:
        os.close(descriptor)
        raise VideoError(f"{shown(path)} {problem}")
    return os.fdopen(descriptor, "rb")


def shown(path: Path) -> str:
    """A path as one printable line."""
    text = str(path)
    return text if text.isprintable() else ascii(text)
