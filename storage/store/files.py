"""Files and folders that appear under their name only when complete: written beside it, then renamed."""

import os
import shutil
import uuid
from collections.abc import Callable
from pathlib import Path

_WRITING = ".writing-"
"""Names of unfinished files and folders start so, followed by the writer's process id."""


def replace_folder(path: Path, fill: Callable[[Path], None]) -> None:
    """Let `fill` write a new folder, then put it in the place of `path` by renaming."""
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = _fresh_name(path)
    old = _fresh_name(path)
    try:
        fresh.mkdir()
        fill(fresh)
        if path.exists():
            path.rename(old)
        fresh.rename(path)
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
        shutil.rmtree(old, ignore_errors=True)


def replace_file(path: Path, fill: Callable[[Path], None]) -> None:
    """Let `fill` write a new file, then put it in the place of `path` by renaming; its name keeps the suffix."""
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = _fresh_name(path)
    try:
        fill(fresh)
        fresh.replace(path)
    finally:
        fresh.unlink(missing_ok=True)


def replace_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8, visible only when complete; bytes of file names that are no UTF-8 become escapes."""

    def fill(fresh: Path) -> None:
        fresh.write_text(text, encoding="utf-8", errors="backslashreplace")

    replace_file(path, fill)


def sync_to_disk(path: Path) -> None:
    """Wait until a file's bytes, or a folder's names, have reached the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def copy_file(source: Path, target: Path) -> None:
    """Copy a file, visible only when complete. A copy, not a link: editing it must never touch the store."""

    def fill(fresh: Path) -> None:
        shutil.copyfile(source, fresh)

    replace_file(target, fill)


def sweep(folder: Path) -> None:
    """Remove what writers that were killed left behind in a folder and below it."""
    for leftover in folder.rglob(f"{_WRITING}*"):
        if not _is_running(int(leftover.name.removeprefix(_WRITING).split("-")[0])):
            shutil.rmtree(leftover) if leftover.is_dir() else leftover.unlink(missing_ok=True)


def _fresh_name(path: Path) -> Path:
    return path.with_name(f"{_WRITING}{os.getpid()}-{uuid.uuid4().hex[:8]}-{path.name}")


def _is_running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
