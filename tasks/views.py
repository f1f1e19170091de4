"""What `humanmm view` writes of a finished run: the page, films, and a file for rerun's viewer."""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Literal

from humanmm.config import DeliverConfig
from humanmm.errors import InputError
from humanmm.storage.run_folder.motion_zarr import MOTION, read_motion
from humanmm.storage.run_folder.run_record import read_run_record
from humanmm.storage.store.files import check_writable, replace_file
from humanmm.storage.view.rerun_file import write_rrd
from humanmm.storage.view.scene import places_of
from humanmm.tasks.films import write_side_by_side, write_world
from humanmm.tasks.pictures import OVERLAY, SCENE, marks_in, source_video, write_overlay, write_page_of

View = Literal["page", "world", "side-by-side", "rerun"]
FILES: dict[View, str] = {
    "page": SCENE, "world": "world.mp4", "side-by-side": "side-by-side.mp4", "rerun": "run.rrd"
}  # fmt: skip


def write_view(
    run_dir: Path,
    view: View,
    path: Path,
    *,
    opacity: float | None = None,
    force: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Path:
    """Write one view of a run to a file; its path. `progress` is called with the frames drawn and all frames.

    `opacity` (0..1) of the bodies on the video instead of the run's own. InputError if the file exists already and
    `force` is not given.
    """
    if path.is_dir():
        raise InputError(f"{path} is a folder; name a file with --out")
    if path.exists() and not force:
        raise InputError(f"{path} exists already; --force replaces it")
    check_writable(path.parent)
    record, recording = read_run_record(run_dir), read_motion(run_dir / MOTION)
    settings = DeliverConfig.model_validate(record["config"]["deliver"])
    if opacity is not None:
        settings = DeliverConfig.model_validate({**settings.model_dump(), "overlay_opacity": opacity})
    places, marks = places_of(record["shots"]), marks_in(record)
    path.parent.mkdir(parents=True, exist_ok=True)
    if view == "world":
        shade = 1.0 if opacity is None else opacity
        replace_file(path, lambda fresh: write_world(fresh, recording, places, opacity=shade, progress=progress))
    elif view == "side-by-side":
        with source_video(recording, record) as (stream, facts):

            def fill(fresh: Path) -> None:
                shade = settings.overlay_opacity
                write_side_by_side(fresh, stream, facts, recording, marks, places, opacity=shade, progress=progress)

            replace_file(path, fill)
    else:
        with tempfile.TemporaryDirectory(prefix="humanmm-view-") as folder:
            overlay = run_dir / "view" / OVERLAY
            if opacity is not None or not overlay.is_file():
                overlay = Path(folder) / OVERLAY
                with source_video(recording, record) as (stream, facts):
                    write_overlay(overlay, stream, facts, recording, marks, settings=settings, progress=progress)
            if view == "rerun":
                write_rrd(path, recording, record, overlay)
            else:
                write_page_of(path, overlay, recording, record)
    return path
