"""`humanmm bench overlay`: how far the bodies of a folder's videos lie from their people in the picture; no truths."""

import logging
from pathlib import Path

from humanmm.config import Config
from humanmm.errors import InputError
from humanmm.flows.bench.clips import recovered
from humanmm.models.evaluation.overlay import PersonOverlay, overlay_of
from humanmm.storage.readers.cut_truth import VIDEOS
from humanmm.storage.store.store import Store
from humanmm.tasks.units.process import prepare_process

log = logging.getLogger(__name__)


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
