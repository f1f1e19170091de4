"""The background of a finished run: the run folder has none, the store may still hold what the cameras have seen."""

import logging
from pathlib import Path

from humanmm.errors import HumanMMError
from humanmm.models.motion.excerpt import WorldScenery
from humanmm.models.motion.scenery import scenery_in_world
from humanmm.models.records.camera import ShotCamera
from humanmm.models.records.recording import Recording
from humanmm.storage.run_folder.run_record import read_run_record
from humanmm.storage.store.open import open_store_of_run
from humanmm.storage.store.store import Store

log = logging.getLogger(__name__)
STAGE = "camera"
"""The stage whose artifact is a `ShotCamera`."""


def kept_scenery(run_dir: Path, recording: Recording) -> WorldScenery:
    """Points of the background, by shot; `recording` is that of the run folder.

    Shots whose camera does not travel have none. Those whose camera cannot be read any more are told in a warning.
    """
    try:
        record = read_run_record(run_dir)
        keys = {one["shot"]: one["key"] for one in record["stages"] if one["stage"] == STAGE and one["key"]}
        store = open_store_of_run(record["store"])
    except (HumanMMError, KeyError) as error:
        log.warning("points of the background cannot be read and are left out: %s", error)
        return {}
    cameras = {shot: _camera(store, key) for shot, key in keys.items()}
    lost = [str(shot) for shot, camera in cameras.items() if camera is None]
    if lost:
        log.warning(
            "points of the background of shot%s are left out: the store %s does not hold what the camera has seen any "
            "more; `humanmm recover --from %s` computes it again",
            f" {lost[0]}" if len(lost) == 1 else f"s {', '.join(lost)}", store.location, STAGE,
        )  # fmt: skip
    found = {shot: scenery_in_world(camera, recording) for shot, camera in cameras.items() if camera is not None}
    return {shot: points for shot, points in found.items() if len(points)}


def _camera(store: Store, key: str) -> ShotCamera | None:
    """The camera of a shot, None if the store cannot give it."""
    try:
        manifest = store.find(STAGE, key)
        return None if manifest is None else store.read(manifest.ref, ShotCamera)
    except HumanMMError:
        return None
