"""A video and a batch as the dashboard shows them: Markdown with small pictures, and rows of a table."""

import base64
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2

from humanmm.models.records.table import Table
from humanmm.storage.batches.video_row import VideoRow
from humanmm.storage.pages.markdown import as_markdown, code, escaped
from humanmm.storage.run_folder.summary import certainty

PICTURES = (("view/top.png", "top view", 480), ("view/timeline.png", "timeline", 800))
"""File, title and width in pixels on the page. Both together take about 60 kB of the dashboard's database."""
JPEG_QUALITY = 70
SHOWN_WARNINGS = 20
SHOWN_ROWS = 200
_ORDER = ("failed", "partial", "running", "done", "cancelled", "scheduled")


def video_page(record: Mapping[str, Any], run_dir: Path) -> str:
    """Markdown of one finished video; `record` is the tree of run.json."""
    video = record["video"]
    seconds = video["num_frames"] / video["fps"] if video["fps"] else 0.0
    warnings = record["warnings"]
    failures = [stage for stage in record["stages"] if stage["state"] == "failed"]
    skipped = sum(stage["state"] == "skipped" for stage in record["stages"])
    lines = [
        f"# {escaped(Path(video['path']).name)}: {record['state']}",
        "",
        f"{video['num_frames']} frames ({seconds:.1f} s, {video['width']} × {video['height']}), "
        f"{len(record['shots'])} shots, {len(record['people'])} people, {record['seconds']:.1f} s in this run.  ",
        f"Run folder: {code(str(run_dir))}",
        "",
        *(f"- {escaped(line)}" for line in certainty(record)),
        "",
        *_failures(failures),
        *([f"- {skipped} more were skipped because of that"] if skipped else []),
        "",
        *_pictures(run_dir),
        "",
        as_markdown([_shots(record)]),
        "; ".join(
            f"person {person['person']} is observed in {person['observed_frames']} of "
            f"{person['end'] - person['start']} frames"
            for person in record["people"]
            if "observed_frames" in person
        ),
        "",
        as_markdown([_stages(record)]),
    ]
    if warnings:
        lines += ["## Warnings", "", *(f"- {escaped(warning)}" for warning in warnings[:SHOWN_WARNINGS])]
        if len(warnings) > SHOWN_WARNINGS:
            lines.append(f"- and {len(warnings) - SHOWN_WARNINGS} more in run.json")
    return "\n".join(lines) + "\n"


def failure_page(video: Path, reason: str, stages: Sequence[Mapping[str, Any]], run_dir: Path) -> str:
    """Markdown of a video that ended with an error; `stages`: as in run.json, as far as it came."""
    failures = [stage for stage in stages if stage["state"] == "failed" and stage["reason"] != reason]
    lines = [
        f"# {escaped(video.name)}: failed",
        "",
        f"**{escaped(reason)}**",
        "",
        f"Video: {code(str(video))}  ",
        f"Run folder: {code(str(run_dir))}, not written",
        "",
        *_failures(failures),
        "",
        *_picture(run_dir.with_name(f"{run_dir.name}.seen.png"), "who was seen", 800),
        "",
        as_markdown([_stages({"stages": stages})]) if stages else "No stage had begun.",
        "",
        "What was computed stays in the store. Once the cause is gone, Retry here, `humanmm batch retry-failed`, or"
        " the same `humanmm recover` goes on from there.",
    ]
    return "\n".join(lines) + "\n"


def _failures(failed: Sequence[Mapping[str, Any]]) -> list[str]:
    return [f"- **{one['stage']}, {escaped(one['unit'])}**: {escaped(one['reason'])}" for one in failed]


def batch_table(rows: Sequence[VideoRow]) -> list[dict[str, Any]]:
    """Rows of a batch for the dashboard, what needs attention first; the newest `SHOWN_ROWS`."""
    ordered = sorted(rows, key=lambda row: (_ORDER.index(row.state), -row.changed))
    return [
        {
            "video": Path(row.video).name,
            "state": row.state,
            "stage": row.stage or "",
            "reason": row.reason,
            "seconds": "" if row.seconds is None else round(row.seconds, 1),
            "attempt": row.attempt,
            "run folder": row.run_dir,
        }
        for row in ordered[:SHOWN_ROWS]
    ]


def _pictures(run_dir: Path) -> list[str]:
    return [line for path, title, width in PICTURES for line in _picture(run_dir / path, title, width)]


def _picture(path: Path, title: str, width: int) -> list[str]:
    """A small copy of a picture; nothing if the user removed it."""
    picture = cv2.imread(str(path)) if path.is_file() else None
    if picture is None:
        return []
    height = max(1, round(picture.shape[0] * width / picture.shape[1]))
    if picture.shape[1] > width:
        picture = cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA)
    _, encoded = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return [f"![{title}](data:image/jpeg;base64,{base64.b64encode(encoded.tobytes()).decode()})\n"]


def _shots(record: Mapping[str, Any]) -> Table:
    rows = []
    for index, shot in enumerate(record["shots"]):
        begins_with = shot["transition"]["type"] if shot["transition"] else ""
        people = ", ".join(str(person) for person in shot["people"]) or "nobody"
        linked, failed = "yes" if shot["linked"] else "no", "failed" if shot["failed"] else ""
        rows.append((str(index), f"{shot['start']} to {shot['end'] - 1}", begins_with, people, linked, failed))
    return Table(("shot", "frames", "begins with", "people", "linked", ""), tuple(rows))


def _stages(record: Mapping[str, Any]) -> Table:
    rows = []
    for name in dict.fromkeys(stage["stage"] for stage in record["stages"]):
        units = [stage for stage in record["stages"] if stage["stage"] == name]
        states = Counter(unit["state"] for unit in units)
        counts = (len(units), *(states[state] for state in ("computed", "cached", "failed", "skipped")))
        rows.append((name, *map(str, counts), f"{sum(unit['seconds'] for unit in units):.1f}"))
    return Table(("stage", "units", "computed", "cached", "failed", "skipped", "seconds"), tuple(rows))
