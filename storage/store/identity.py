"""The content hash of a video, computed once and cached in the store by path, size, modification time and inode."""

import hashlib
import json
import os
import stat
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path
from typing import Any, BinaryIO, cast

from humanmm.errors import VideoError
from humanmm.storage.store.store import Store


@dataclass(frozen=True)
class VideoIdentity:
    """A file and its state when its content was hashed."""

    path: Path
    sha256: str
    size: int
    mtime_ns: int
    inode: int

    def open(self) -> BinaryIO:
        """The file's bytes; an error if it is no longer the file that was hashed."""
        file = open_video_file(self.path)
        status = os.fstat(file.fileno())
        if (status.st_size, status.st_mtime_ns, status.st_ino) != (self.size, self.mtime_ns, self.inode):
            file.close()
            raise VideoError(f"{shown(self.path)} changed while it was being processed; run again")
        return file


def identify(path: Path, store: Store) -> VideoIdentity:
    """The content hash of a video. VideoError unless it is a readable, non-empty file."""
    path = path.expanduser().absolute()
    with open_video_file(path) as file:
        status = os.fstat(file.fileno())
        facts = {"size": status.st_size, "mtime_ns": status.st_mtime_ns, "inode": status.st_ino}
        known = known_content(path, store)
        if all(known.get(name) == value for name, value in facts.items()):
            return VideoIdentity(path, str(known["sha256"]), **facts)
        digest = hashlib.file_digest(cast(BufferedReader, file), "sha256").hexdigest()
    store.write_text(_record(path, store), json.dumps({**facts, "sha256": digest}))
    return VideoIdentity(path, digest, **facts)


def known_content(path: Path, store: Store) -> dict[str, Any]:
    """The cached sha256, size, mtime_ns and inode of a file; empty if this machine never hashed it."""
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
