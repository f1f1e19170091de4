"""Pictures and page of a run folder: made by stage `deliver`, at the end of every run, again by `humanmm view`."""

import hashlib
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from humanmm.config import DecodeConfig, DeliverConfig
from humanmm.errors import InputError
from humanmm.models.drawing.candidates import candidates, draw_candidate, side_by_side
from humanmm.models.drawing.canvas import Canvas
from humanmm.models.drawing.overlay import Mark, Overlay
from humanmm.models.drawing.timeline import StageTime, timeline
from humanmm.models.drawing.top_view import top_view
from humanmm.models.perception.picture import Picture
from humanmm.models.records.recording import Recording
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.models.video.colors import read_colors
from humanmm.models.video.frames import PlanarFrame, joined, planar_frames, planar_size
from humanmm.models.video.prefetch import prefetched
from humanmm.models.video.reading import read_facts
from humanmm.storage.run_folder.motion_zarr import MOTION, read_motion
from humanmm.storage.run_folder.picture_files import write_png, write_video
from humanmm.storage.run_folder.run_record import read_run_record
from humanmm.storage.store.files import replace_file
from humanmm.storage.view.embedded_video import EmbeddedVideo, write_embedded
from humanmm.storage.view.page import write_page
from humanmm.storage.view.scene import with_worlds

OVERLAY, TOP_VIEW, TIMELINE, SCENE = "overlay.mp4", "top.png", "timeline.png", "scene.html"
EMBEDDED = "embedded.mp4"
"""The video inside scene.html, beside the pictures in the artifact of `deliver`; not in the run folder."""
_CANDIDATE_PX = 1920
_PREFETCHED = 4
"""Pictures that wait for being drawn, and for being encoded."""


def write_candidates(path: Path, stream: BinaryIO, facts: VideoFacts, scenes: Sequence[ScenePeople | None]) -> None:
    """A picture of those who were seen in a video in which nobody could be recovered."""
    shown = []
    for candidate in candidates(scenes, facts.num_frames):
        at = candidate.frame
        (frame,) = planar_frames(stream, facts, at, at + 1, max_side_px=_CANDIDATE_PX)
        shown.append(draw_candidate(candidate, Picture(frame.planes, frame.colors), facts.width))
    path.parent.mkdir(parents=True, exist_ok=True)
    write_png(path, side_by_side(shown))


def write_overlay(
    path: Path,
    stream: BinaryIO,
    facts: VideoFacts,
    recording: Recording,
    marks: Sequence[Mark],
    *,
    settings: DeliverConfig,
    progress: Callable[[int, int], None] = lambda done, total: None,
    embedded: Path | None = None,
) -> None:
    """Decode the video once more, draw the people on every frame, and encode it: three threads, a few pictures.

    `embedded` is where the small copy for the page goes.
    """
    width, height = planar_size(facts, settings.overlay_max_side_px)
    colors = read_colors(stream)
    overlay = Overlay(recording, tuple(marks), width, height, colors, opacity=settings.overlay_opacity)

    canvases = [np.empty((height * 3 // 2, width), np.uint8) for _ in range(_PREFETCHED)]

    def drawn(decoded: Iterator[PlanarFrame]) -> Iterator[tuple[float, np.ndarray]]:
        for frame in decoded:
            image = joined(frame.planes, canvases[frame.index % _PREFETCHED])
            overlay.draw(image, frame.index)
            if small is not None:
                small.add(frame.time_s, Canvas(image, colors).planes)
            progress(frame.index + 1, facts.num_frames)
            yield frame.time_s, image

    planes = planar_frames(stream, facts, 0, facts.num_frames, max_side_px=settings.overlay_max_side_px)
    with ExitStack() as stack:
        small = None if embedded is None else stack.enter_context(EmbeddedVideo(embedded, facts, colors))
        decoded = stack.enter_context(prefetched(planes, _PREFETCHED))
        pictures = stack.enter_context(prefetched(drawn(decoded), _PREFETCHED))
        write_video(
            path, pictures, width=width, height=height, fps=facts.fps, colors=colors, quality=settings.overlay_quality
        )


def write_timeline(run_dir: Path, recording: Recording, record: Mapping[str, Any]) -> None:
    """Draw view/timeline.png; `record` is the tree of run.json. It shows what this run took, so it is never cached."""
    failures = [
        f"{one['stage']}, {one['unit']} {one['state']}: {one['reason']}"
        for one in record["stages"]
        if one["state"] in ("failed", "skipped")
    ]
    image = timeline(recording, marks_in(record), stage_times(record), [*failures, *record["warnings"]])
    replace_file(run_dir / "view" / TIMELINE, lambda fresh: write_png(fresh, image))


def write_scene(run_dir: Path, recording: Recording, record: Mapping[str, Any], video: Path) -> None:
    """Write view/scene.html with a video that `write_embedded` made, or remove it if there is no such file.

    `record` is the tree of run.json, whose warnings and shots the page shows: like the timeline, it is never cached.
    """
    scene = run_dir / "view" / SCENE
    if video.is_file():
        write_page(scene, recording, record, video)
    else:
        scene.unlink(missing_ok=True)


def write_page_of(page: Path, overlay: Path, recording: Recording, record: Mapping[str, Any]) -> None:
    """The page of a run, with a small copy of an overlay inside."""
    with tempfile.TemporaryDirectory(prefix="humanmm-page-") as folder:
        write_embedded(overlay, Path(folder) / EMBEDDED)
        write_page(page, recording, record, Path(folder) / EMBEDDED)


def draw_again(
    run_dir: Path, *, force: bool, progress: Callable[[int, int], None] = lambda done, total: None
) -> tuple[Path, ...]:
    """Draw those pictures of a finished run that are missing (all of them with `force`); paths of all pictures."""
    record = read_run_record(run_dir)
    recording = with_worlds(read_motion(run_dir / MOTION), record)
    view = run_dir / "view"

    def is_wanted(name: str) -> bool:
        return force or not (view / name).exists()

    if is_wanted(OVERLAY):
        settings = DeliverConfig.model_validate(record["config"]["deliver"])
        with source_video(recording, record) as (stream, facts):

            def fill(fresh: Path) -> None:
                write_overlay(fresh, stream, facts, recording, marks_in(record), settings=settings, progress=progress)

            replace_file(view / OVERLAY, fill)
    if is_wanted(TOP_VIEW):
        replace_file(view / TOP_VIEW, lambda fresh: write_png(fresh, top_view(recording)))
    if is_wanted(TIMELINE):
        write_timeline(run_dir, recording, record)
    return tuple(view / name for name in (OVERLAY, TOP_VIEW, TIMELINE))


def marks_in(record: Mapping[str, Any]) -> tuple[Mark, ...]:
    """The changes of shot that run.json names."""
    transitions = [shot["transition"] for shot in record["shots"] if shot["transition"] is not None]
    return tuple(Mark(t["type"], int(t["start"]), int(t["end"])) for t in transitions)


def stage_times(record: Mapping[str, Any]) -> list[StageTime]:
    """Seconds and states of run.json's stages, the units of a stage added up, in their order."""
    rows: dict[str, list[Mapping[str, Any]]] = {}
    for entry in record["stages"]:
        rows.setdefault(entry["stage"], []).append(entry)
    return [
        StageTime(
            stage=stage,
            seconds=sum(float(unit["seconds"]) for unit in units),
            units=len(units),
            cached_units=sum(unit["state"] == "cached" for unit in units),
            failed_units=sum(unit["state"] == "failed" for unit in units),
        )
        for stage, units in rows.items()
    ]


@contextmanager
def source_video(recording: Recording, record: Mapping[str, Any]) -> Iterator[tuple[BinaryIO, VideoFacts]]:
    """The video of a run, open, and what is known of it. InputError if it is gone, or another one now."""
    settings = DecodeConfig.model_validate(record["config"]["decode"])
    video = Path(record["video"]["path"])
    try:
        stream = video.open("rb")
    except OSError as error:
        raise InputError(f"the overlay needs the video {video}, which cannot be read ({error.strerror})") from None
    with stream:
        if hashlib.file_digest(stream, "sha256").hexdigest() != record["video"]["sha256"]:
            raise InputError(f"{video} is not the video of this run any more; recover it again")
        stream.seek(0)
        facts = read_facts(stream, max_side_px=settings.max_side_px, max_memory_mb=settings.max_memory_mb)
        if not np.array_equal(facts.time_s, recording.time_s):
            raise InputError(f"{video} has other frame times than motion.zarr; recover it again")
        yield stream, facts
