"""The stores whose batches were scheduled on our server: `humanmm serve` looks after them."""

import fcntl
from pathlib import Path

from humanmm.flows.server.local_server import ServerFiles
from humanmm.storage.store.bucket import is_bucket


def note_store(files: ServerFiles, place: str) -> None:
    """Remember a store."""
    if place not in known_stores(files):
        with files.stores.open("a") as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            file.write(f"{place}\n")


def known_stores(files: ServerFiles) -> list[str]:
    """The stores that are still there, and those in buckets."""
    lines = files.stores.read_text().splitlines() if files.stores.exists() else []
    return [line for line in dict.fromkeys(lines) if is_bucket(line) or Path(line).is_dir()]
