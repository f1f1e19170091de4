"""Which processes compute a video, and for the workers of which mark: asked by whoever has to stop them.

On Linux a process has a name, and /proc has its environment. Other systems show neither of a running process: there
each one leaves a file, named by its mark and number, with the time at which it was started.
"""

import contextlib
import os
import sys
import tempfile
from pathlib import Path

from humanmm.machine import PROC, started
from humanmm.storage.store.files import replace_text
from humanmm.tasks.units.process import name_process

VIDEO = "humanmm-video"
"""Name of the process of a video, as `ps` and `top` show it on Linux."""
MARK = "WORKER_OF_HUMANMM"
"""Variable, no setting, that marks a worker's videos: a session may have several workers, and a
number of a process is given again."""


def begin_video() -> None:
    """Be found by `videos_of` from now on, for the mark in this process's environment."""
    if sys.platform == "linux":
        name_process(VIDEO)
        return
    folder = _folder()
    for file in folder.iterdir():
        if not file.name.startswith(".") and not _is_that_of_its_file(file):  # of one that was killed
            file.unlink(missing_ok=True)
    replace_text(folder / f"{os.environ.get(MARK, '')}.{os.getpid()}", str(started(os.getpid())))


def videos_of(mark: str) -> list[int]:
    """Living processes of this user that compute a video for workers with a mark."""
    if sys.platform != "linux":
        files = _folder().glob(f"{mark}.*")
        return [int(file.suffix[1:]) for file in files if _is_that_of_its_file(file)]
    found = []
    for process in PROC.glob("[0-9]*"):
        with contextlib.suppress(OSError):  # it has ended, or is another user's
            state = (process / "stat").read_text().rpartition(")")[2].split()[0]
            if state in "ZX" or (process / "comm").read_text().strip() != VIDEO:
                continue
            if f"{MARK}={mark}".encode() in (process / "environ").read_bytes().split(b"\0"):
                found.append(int(process.name))
    return found


def _folder() -> Path:
    """This user's own; an error if another user made it."""
    folder = Path(tempfile.gettempdir()) / f"humanmm-videos-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    if folder.stat().st_uid != os.getuid():
        raise PermissionError(f"{folder} belongs to another user: remove it, or set TMPDIR to a folder of your own")
    return folder


def _is_that_of_its_file(file: Path) -> bool:
    """Whether the process of a file is the one that wrote it."""
    began = started(int(file.suffix[1:]))
    try:
        return began is not None and file.read_text() == str(began)
    except OSError:  # another process has just removed it
        return False
