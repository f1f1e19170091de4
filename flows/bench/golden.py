"""`humanmm bench golden` and `overlay`: real clips without truths.

Golden: clips that somebody looked at, and whether what was recovered is what he saw. Overlay: how far bodies lie from
the people of the picture.

DIR/golden.toml lists the clips; without one, the list of the repository is checked on the videos of DIR. A clip that
is cut from them is made once and kept in the cache.
"""

import functools
import hashlib
import logging
from collections.abc import Sequence
from pathlib import Path

from humanmm.config import Config
from humanmm.errors import InputError
from humanmm.flows.bench.clips import recovered
from humanmm.models.benchmark.expectations import GoldenClip
from humanmm.models.benchmark.golden import verdicts
from humanmm.models.benchmark.tables.golden import CheckedClip
from humanmm.models.evaluation.overlay import PersonOverlay, overlay_of
from humanmm.storage.readers.cut_truth import VIDEOS
from humanmm.storage.readers.golden_list import read_golden_list
from humanmm.storage.run_folder.cut_clip import write_cut_clip
from humanmm.storage.store.files import replace_file
from humanmm.storage.store.identity import identify
from humanmm.storage.store.store import Store, cache_folder
from humanmm.tasks.units.digest import code_digest
from humanmm.tasks.units.process import prepare_process
from humanmm.version import __file__ as package_file

log = logging.getLogger(__name__)

LIST = "golden.toml"
CUTTING_CODE = "humanmm.storage.run_folder.cut_clip"


def golden_list(folder: Path) -> tuple[GoldenClip, ...]:
    """The list in the folder of videos, else the repository's."""
    shipped = Path(package_file).resolve().parents[2] / "examples" / LIST
    for path in (folder / LIST, shipped):
        if path.is_file():
            return read_golden_list(path)
    raise InputError(f"{folder} holds no {LIST}, and {shipped} is not there: give a folder that has one")


def checked_clips(folder: Path, config: Config, store: Store) -> tuple[list[CheckedClip], list[str]]:
    """Every clip whose videos are in the folder, checked; and a sentence for each that is left out."""
    prepare_process()
    checked, left_out = [], []
    clips = golden_list(folder)
    for number, clip in enumerate(clips, start=1):
        missing = [video for video in _videos(clip) if not (folder / video).is_file()]
        if missing:
            left_out.append(f"{clip.name} is left out: {folder} holds no {', '.join(missing)}")
            continue
        seen = recovered(video_of(clip, folder, store), config, store)
        if seen.refused:
            log.info("%s: %s", clip.name, seen.refused)
        checked.append(CheckedClip(clip.name, seen.ending, tuple(verdicts(clip, seen))))
        log.info("%s: %d of %d clips", clip.name, number, len(clips))
    if not checked:
        raise InputError(f"{folder} holds none of the videos of the golden set")
    return checked, left_out


def video_of(clip: GoldenClip, folder: Path, store: Store) -> Path:
    """The clip as a file: a video of the folder itself, or one that is cut now or was cut before."""
    if not clip.is_cut:
        return folder / clip.parts[0].video
    key = hashlib.sha256(repr((clip.parts, clip.size)).encode())
    for video in _videos(clip):
        key.update(identify(folder / video, store).sha256.encode())
    key.update(repr(sorted(code_digest(CUTTING_CODE).modules.items())).encode())
    path = cache_folder() / "golden" / f"{clip.name}-{key.hexdigest()[:16]}.mp4"
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, functools.partial(write_cut_clip, parts=clip.parts, folder=folder, size=clip.size))
    return path


def _videos(clip: GoldenClip) -> Sequence[str]:
    """Every video that its parts name, once."""
    named = [(part.video, part.poster.video if part.poster else part.video) for part in clip.parts]
    return list(dict.fromkeys(video for pair in named for video in pair))


def overlays(folder: Path, config: Config, store: Store) -> tuple[dict[str, list[PersonOverlay]], list[str]]:
    """By video, below the folder and the folders in it: its people; and a sentence for each that was refused."""
    prepare_process()
    videos = sorted(path for path in folder.rglob("*") if path.suffix.lower() in VIDEOS) if folder.is_dir() else []
    if not videos:
        raise InputError(f"{folder} is no folder that holds videos")
    found, refused = {}, []
    for number, video in enumerate(videos, start=1):
        name = str(video.relative_to(folder).with_suffix(""))
        seen = recovered(video, config, store)
        if seen.recording is None:
            refused.append(f"{name}: {seen.refused}")
        else:
            found[name] = overlay_of(seen.recording)
        log.info("%s: %d of %d videos", name, number, len(videos))
    return found, refused
