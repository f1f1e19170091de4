"""Files and folders that appear under their name only when complete: written beside it, then renamed."""

import contextlib
import errno
import hashlib
import os
import re
import shutil
import tempfile
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path

from humanmm.errors import InputError, StoreError

OTHER_STORE, OTHER_FOLDER = "another store with --store", "another folder with --out"
"""What may be named in place of a store, and of an output folder, that cannot be written."""
_WRITING = ".writing-"
"""Prefix of the names of unfinished files and folders; the writer's process id follows."""
_LEFTOVER = re.compile(rf"{re.escape(_WRITING)}(\d{{1,9}})-")


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


@contextlib.contextmanager
def no_empty_folder_left(folder: Path) -> Iterator[None]:
    """Where what is done fails, `folder` and those around it that were not there before go again if they are empty."""
    new = [one for one in (folder, *folder.parents) if not one.exists()]
    try:
        yield
    except BaseException:
        with contextlib.suppress(OSError):
            for one in new:
                one.rmdir()
        raise


def replace_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8, visible only when complete; bytes of file names that are no UTF-8 become escapes."""

    def fill(fresh: Path) -> None:
        fresh.write_text(text, encoding="utf-8", errors="backslashreplace")

    replace_file(path, fill)


def file_sha256(path: Path) -> str:
    """sha256 of a file's bytes, as hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


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


def refusal_to_write(folder: Path) -> str:
    """Why a file cannot be written in a folder that there is; empty if one was written, and removed again. Rights alone
    do not tell: root has all of them in /proc, and on a disk that is read-only."""
    try:
        try_to_write(folder)
    except OSError as error:
        return (error.strerror or str(error)).lower()
    return ""


def try_to_write(folder: Path) -> None:
    """Write a file in a folder and remove it again; OSError if that cannot be done."""
    with tempfile.NamedTemporaryFile(dir=folder, prefix=".humanmm-") as file:
        file.write(b"here")


def existing_part(path: Path) -> Path:
    """As much of a path as there is."""
    existing = path.absolute()
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    return existing


def check_writable(folder: Path) -> None:
    """Raise InputError, before anything is computed, if an output folder cannot be written."""
    existing = existing_part(folder)
    if not existing.is_dir():
        raise InputError(f"the output folder {folder} cannot be made: {existing} is a file; name another with --out")
    refusal = refusal_to_write(existing)
    if refusal:
        raise InputError(
            f"the output folder {folder} is not writable: {refusal} in {existing}; name another with --out"
        )


@contextlib.contextmanager
def store_errors(what: str, *, missing: bool = False, other: str = OTHER_STORE) -> Iterator[None]:
    """Raise file-system faults of the block as StoreError; FileNotFoundError stays as it is unless `missing`. `other`:
    what may be named in its place."""
    try:
        yield
    except OSError as error:
        if isinstance(error, FileNotFoundError) and not missing:
            raise
        raise StoreError(explain_os_error(error, what, other=other)) from error


def explain_os_error(error: OSError, what: str, *, other: str = OTHER_STORE) -> str:
    """One sentence for a file-system fault: what failed, why, what to do; `other`: what may be named in its place."""
    advice = {
        errno.ENOSPC: f"the disk is full; free some space or name {other}",
        errno.EDQUOT: f"the disk quota is used up; free some space or name {other}",
        errno.EFBIG: "the file would grow past this process's limit (ulimit -f)",
        errno.EACCES: f"permission denied; name {other}, one that you may write",
        errno.EPERM: f"permission denied; name {other}, one that you may write",
        errno.EROFS: f"the disk is read-only; name {other}",
        errno.ENOENT: "there is no such folder, and none can be made there; name another folder",
        errno.ENOTDIR: "a part of the path is a file; name another folder",
        errno.EEXIST: "a file of that name is in the way; name another folder",
    }
    return f"{what}: {advice.get(error.errno or 0, error.strerror or str(error))}"


def sweep(folder: Path) -> None:
    """Remove unfinished files of killed writers from a folder and its subfolders."""
    for leftover in folder.rglob(f"{_WRITING}*"):
        writer = _LEFTOVER.match(leftover.name)
        if writer and not _is_running(int(writer[1])):
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
