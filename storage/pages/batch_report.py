"""The report of a batch: one row a video, as HTML to look at and as CSV to compute with.

The page has a picture and the warnings of every video, and sorts and filters its rows by itself: no server is needed.
"""

import base64
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from humanmm.errors import InputError
from humanmm.storage.batches.video_row import VideoRow, counts, counts_in_words
from humanmm.storage.pages.html import fill
from humanmm.storage.pages.spreadsheet import as_csv
from humanmm.storage.run_folder.run_record import read_run_record
from humanmm.storage.store.files import replace_text

COLUMNS = (
    "video", "state", "stage", "reason", "frames", "shots", "people", "seconds", "warnings", "attempt", "run_dir",
    "overlay", "fps", "heights_m", "worst_pose_error_mm", "doubtful_s", "least_join_probability", "motion",
)  # fmt: skip


@dataclass(frozen=True)
class _Result:
    """What run.json adds to a row of the batch table; empty for videos without a result."""

    name: str
    link: str = ""
    """To the run folder, from the report's folder."""
    frames: int | str = ""
    shots: int | str = ""
    people: int | str = ""
    figures: tuple[object, ...] = ("",) * 5
    """The columns `fps` to `least_join_probability`."""
    motion: str = ""
    warnings: tuple[str, ...] = ()
    overlay: str = ""
    overlay_link: str = ""
    scene_link: str = ""
    seen_link: str = ""
    """To the picture of who was seen, of a video in which nobody could be recovered."""
    thumbnail: str = ""
    """A small picture of the overlay's middle as a data URL; empty if there is none."""


THUMBNAIL_PX = 160
"""Longest side."""
JPEG_QUALITY = 60
MOST_THUMBNAILS = 2000
"""About 5 kB each: the page of a larger batch has none."""


def write_report(folder: Path, name: str, rows: Sequence[VideoRow]) -> list[Path]:
    """Write report.html and report.csv into a folder; returns their paths."""
    pictured = len(rows) <= MOST_THUMBNAILS
    videos = [(row, _result(row, folder, pictured=pictured)) for row in rows]
    summary = counts_in_words(rows)
    lines = [
        (
            row.video, row.state, row.stage or "", row.reason, result.frames, result.shots, result.people,
            "" if row.seconds is None else row.seconds, len(result.warnings), row.attempt, row.run_dir, result.overlay,
            *result.figures, result.motion,
        )
        for row, result in videos
    ]  # fmt: skip
    texts = {
        "report.html": fill("batch.html", name=name, videos=videos, summary=summary, states=counts(rows)),
        "report.csv": as_csv([COLUMNS, *lines]),
    }
    for file, text in texts.items():
        replace_text(folder / file, text)
    return [folder / file for file in texts]


def _result(row: VideoRow, folder: Path, *, pictured: bool) -> _Result:
    name = Path(row.video).name
    if row.state not in ("done", "partial"):
        seen = Path(f"{row.run_dir}.seen.png")
        return _Result(name, seen_link=_link(str(seen), folder) if row.run_dir and seen.is_file() else "")
    link = _link(row.run_dir, folder)
    try:
        record = read_run_record(Path(row.run_dir))
        overlay = Path(row.run_dir) / "view" / "overlay.mp4"
        has_overlay = overlay.is_file()
        scene = Path(row.run_dir) / "view" / "scene.html"
        motion = Path(row.run_dir) / "motion.zarr"
        return _Result(
            name=name,
            link=link,
            frames=int(record["video"]["num_frames"]),
            shots=len(record["shots"]),
            people=len(record["people"]),
            figures=_figures(record),
            motion=str(motion) if motion.is_dir() else "",
            warnings=tuple(str(warning) for warning in record["warnings"]),
            overlay=str(overlay) if has_overlay else "",
            overlay_link=_link(str(overlay), folder) if has_overlay else "",
            scene_link=_link(str(scene), folder) if scene.is_file() else "",
            thumbnail=_thumbnail(overlay) if has_overlay and pictured else "",
        )
    except InputError as error:
        reason = f"its run folder is on {row.host}" if row.is_elsewhere else f"its run folder cannot be read: {error}"
        return _Result(name, link, warnings=(reason,))
    except (KeyError, TypeError, ValueError) as error:
        return _Result(name, link, warnings=(f"its run folder cannot be read: {error}",))


def _figures(record: Mapping[str, Any]) -> tuple[object, ...]:
    """Frame rate; heights (`0: 1.75; 1: 1.62`); the largest expected error of a pose; seconds of frames in which
    somebody's pose or direction is doubtful; the least probability of a join."""
    fps, shots = record["video"].get("fps"), record["shots"]
    heights = "; ".join(f"{one['person']}: {one['height_m']}" for one in record["people"] if "height_m" in one)
    errors = [one["error_mm"] for shot in shots for one in shot.get("pose", ()) if one["error_mm"] is not None]
    spans = [
        range(*span)
        for shot in shots
        for kind in ("pose", "facing")
        for one in shot.get(kind, ())
        for span in one["doubtful"]
    ]
    doubtful_s = round(len(set().union(*spans)) / fps, 2) if fps else ""
    joins = [shot["join"]["probability"] for shot in shots if shot.get("join") and shot["linked"]]
    likely = [probability for probability in joins if probability is not None]
    return (fps or "", heights, max(errors, default=""), doubtful_s, min(likely, default=""))


def _thumbnail(overlay: Path) -> str:
    """The picture of the middle of a film, small, as a data URL; empty if it cannot be read."""
    import av
    import cv2

    try:
        with av.open(str(overlay)) as container:
            stream = container.streams.video[0]
            stream.codec_context.skip_frame = "NONKEY"
            container.seek((container.duration or 0) // 2)
            frame = next(container.decode(stream))
            scale = THUMBNAIL_PX / max(frame.width, frame.height)
            width, height = (max(2, round(scale * side / 2) * 2) for side in (frame.width, frame.height))
            picture = frame.reformat(width=width, height=height, format="bgr24").to_ndarray()
    except (av.FFmpegError, OSError, StopIteration, IndexError):
        return ""
    _, encoded = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return f"data:image/jpeg;base64,{base64.b64encode(encoded.tobytes()).decode()}"


def _link(path: str, folder: Path) -> str:
    """Relative, so that runs and report can be moved together."""
    return quote(os.path.relpath(path, folder.absolute()), errors="surrogateescape")
