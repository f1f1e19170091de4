"""A video and a batch as the dashboard shows them: Markdown with small pictures, and rows of a table."""

import base64
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2

from humanmm.storage.batches.batch_ledger import VideoRow

PICTURES = (("view/top.png", "top view", 480), ("view/timeline.png", "timeline", 800))
"""File, title and width in pixels on the page. Both together take about 60 kB of the dashboard's database."""
JPEG_QUALITY = 70
SHOWN_WARNINGS = 20
SHOWN_ROWS = 200
_ORDER = ("failed", "partial", "running", "done", "cancelled", "scheduled")


def video_page(record: Mapping[str, Any], run_dir: Path) -> str:
    """Markdown of one finished video; `record` is the tree of run.json."""
    video = record["video"]
    name = Path(video["path"]).name
    seconds = video["num_frames"] / video["fps"] if video["fps"] else 0.0
    lines = [
        f"# {_text(name)}: {record['state']}",
        "",
        f"{video['num_frames']} frames ({seconds:.1f} s, {video['width']} × {video['height']}), "
        f"{len(record['shots'])} shots, {len(record['people'])} people, {record['seconds']:.1f} s in this run.  ",
        f"Run folder: `{run_dir}`",
        "",
    ]
    for failure in record["failures"]:
        lines.append(f"- **{failure['stage']}, {failure['unit']}**: {_text(failure['reason'])}")
    lines += ["", *_pictures(run_dir), "", *_shots(record), "", *_stages(record), ""]
    warnings = [*record["fallbacks"], *record["warnings"]]
    if warnings:
        lines += ["## Warnings", "", *(f"- {_text(warning)}" for warning in warnings[:SHOWN_WARNINGS])]
        if len(warnings) > SHOWN_WARNINGS:
            lines.append(f"- and {len(warnings) - SHOWN_WARNINGS} more in run.json")
    return "\n".join(lines) + "\n"


def batch_table(rows: Sequence[VideoRow]) -> list[dict[str, Any]]:
    """Rows of a batch for the dashboard, what needs somebody first; the newest `SHOWN_ROWS`."""
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
    shown = []
    for path, title, width in PICTURES:
        picture = cv2.imread(str(run_dir / path)) if (run_dir / path).is_file() else None
        if picture is None:  # the folder was tidied up
            continue
        height = max(1, round(picture.shape[0] * width / picture.shape[1]))
        if picture.shape[1] > width:
            picture = cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA)
        _, encoded = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        shown.append(f"![{title}](data:image/jpeg;base64,{base64.b64encode(encoded.tobytes()).decode()})\n")
    return shown


def _shots(record: Mapping[str, Any]) -> list[str]:
    lines = ["| shot | frames | begins with | people | linked | |", "|---|---|---|---|---|---|"]
    for index, shot in enumerate(record["shots"]):
        how = shot["transition"]["type"] if shot["transition"] else ""
        people = ", ".join(str(person) for person in shot["people"]) or "nobody"
        linked, failed = "yes" if shot["linked"] else "no", "failed" if shot["failed"] else ""
        lines.append(f"| {index} | {shot['start']}–{shot['end']} | {how} | {people} | {linked} | {failed} |")
    seen = [
        f"person {person['person']} is observed in {person['observed_frames']} of "
        f"{person['end'] - person['start']} frames"
        for person in record["people"]
        if "observed_frames" in person
    ]
    return [*lines, "", "; ".join(seen)]


def _stages(record: Mapping[str, Any]) -> list[str]:
    lines = ["| stage | units | computed | cached | failed | seconds |", "|---|---|---|---|---|---|"]
    names = dict.fromkeys(stage["stage"] for stage in record["stages"])
    for name in names:
        units = [stage for stage in record["stages"] if stage["stage"] == name]
        states = [unit["state"] for unit in units]
        counts = (states.count("computed"), states.count("cached"), states.count("failed") + states.count("skipped"))
        lines.append(
            f"| {name} | {len(units)} | {counts[0]} | {counts[1]} | {counts[2]} "
            f"| {sum(unit['seconds'] for unit in units):.1f} |"
        )
    return lines


def _text(text: str) -> str:
    """Somebody else's words: no markup of theirs gets through."""
    escaped = "".join(f"\\{c}" if c in "\\`*_[]#|<>!" else c for c in " ".join(text.split()))
    return escaped.encode("utf-8", "backslashreplace").decode()
