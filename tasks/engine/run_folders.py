"""Which run folder a video gets: that of its name, unless another video has it."""

import hashlib
import itertools
import logging
import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from humanmm.errors import InputError, VideoError
from humanmm.storage.run_folder.corrections_file import FILE as CORRECTIONS
from humanmm.storage.run_folder.run_record import FILE as RECORD
from humanmm.storage.run_folder.run_record import read_run_record
from humanmm.storage.store.identity import VideoIdentity, identify
from humanmm.storage.store.store import Store
from humanmm.tasks.engine.finish import default_run_dir

log = logging.getLogger(__name__)
DIGITS = 8


def run_dir_of(video: VideoIdentity, out: Path | None, store: Store) -> Path:
    """The run folder of one video: `out`, or without it one in runs/."""
    return out if out is not None else RunFolders(default_run_dir(video.path).parent, store).of(video.path)


def check_replaceable(run_dir: Path, sha256: str) -> None:
    """InputError if a folder holds the run of another video than that of this content, with corrections."""
    held = content_of(run_dir)
    if held in (None, sha256):
        return
    if (run_dir / CORRECTIONS).is_file():
        raise InputError(
            f"{run_dir} holds the run of another video with corrections; name another folder with --out, or move "
            f"{run_dir / CORRECTIONS} away"
        )
    log.warning("%s holds the run of another video, which this run replaces", run_dir)


def content_of(run_dir: Path) -> str | None:
    """sha256 of the video whose run a folder holds; None if it holds none that can be read."""
    try:
        return str(read_run_record(run_dir)["video"]["sha256"])
    except (InputError, KeyError, TypeError):
        return None


class RunFolders:
    """A run folder for each of several videos: its stem; with eight digits of its content if another video has that
    stem. The same content keeps its folder wherever it lies."""

    def __init__(self, out: Path, store: Store, taken: Iterable[Path] = ()) -> None:
        self._out, self._store, self._taken = out, store, set(taken)
        names = os.listdir(out) if out.is_dir() else []  # noqa: PTH208  (of 10,000 folders)
        self._with_digits = {name[: -DIGITS - 1] for name in names if name[-DIGITS - 1 : -DIGITS] == "-"}

    def of(self, video: Path) -> Path:
        """The folder of the next video; no later one gets it. Hashes the video if its stem is another's already."""
        plain = self._out / default_run_dir(video).name
        is_known = plain in self._taken or plain.name in self._with_digits or (plain / RECORD).exists()
        path = self._of_content(plain, video) if is_known else plain
        self._taken.add(path)
        return path

    def take(self, path: Path) -> bool:
        """Let no later video have a folder; whether none had it already."""
        is_free = path not in self._taken
        self._taken.add(path)
        return is_free

    def _of_content(self, plain: Path, video: Path) -> Path:
        try:
            sha256 = identify(video, self._store).sha256
        except VideoError:  # it will fail with its reason, and write no folder
            sha256 = hashlib.sha256(os.fsencode(video)).hexdigest()
        first = [path for path in itertools.islice(_candidates(plain, sha256), 2) if path not in self._taken]
        for path in first:
            if content_of(path) == sha256:
                return path
        path = next(p for p in _candidates(plain, sha256) if p not in self._taken and content_of(p) is None)
        if path != plain and plain not in self._taken:
            log.warning("%s holds the run of another video; that of %s goes to %s", plain, video, path)
        return path


def _candidates(plain: Path, sha256: str) -> Iterator[Path]:
    """The folders that a video may have, in order; the last ones for copies under one name."""
    yield plain
    digits = plain.with_name(f"{plain.name}-{sha256[:DIGITS]}")
    yield digits
    yield from (digits.with_name(f"{digits.name}-{count}") for count in itertools.count(2))
