"""The report of a batch: one row a video, as HTML to look at and as CSV to compute with."""

import csv
import html
import io
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from humanmm.errors import InputError
from humanmm.storage.batches.batch_ledger import VideoRow, counts
from humanmm.storage.run_folder.run_record import read_run_record
from humanmm.storage.store.files import replace_file

COLUMNS = (
    "video", "state", "stage", "reason", "frames", "shots", "people", "seconds", "warnings", "attempt", "run_dir",
    "overlay",
)  # fmt: skip

_STYLE = """
body { font: 14px/1.4 system-ui, sans-serif; margin: 2em; color: #222; background: #fff }
table { border-collapse: collapse } th, td { padding: .3em .7em; text-align: left; border-bottom: 1px solid #ddd }
td.number { text-align: right; font-variant-numeric: tabular-nums }
.done { color: #17692b } .partial { color: #8a5a00 } .failed { color: #b00020 } .cancelled { color: #666 }
"""


@dataclass(frozen=True)
class _Found:
    """What run.json adds to a row of the ledger; empty for videos without a result."""

    frames: int | str = ""
    shots: int | str = ""
    people: int | str = ""
    warnings: tuple[str, ...] = ()
    overlay: str = ""


def write_report(folder: Path, name: str, rows: Sequence[VideoRow]) -> list[Path]:
    """Write report.html and report.csv into a folder; returns their paths."""
    lines = [(row, _look(row)) for row in rows]
    texts = {"report.html": _as_html(name, lines, folder), "report.csv": _as_csv(lines)}
    for file, text in texts.items():
        _put(folder / file, text)
    return [folder / file for file in texts]


def _look(row: VideoRow) -> _Found:
    if row.state not in ("done", "partial"):
        return _Found()
    try:
        record = read_run_record(Path(row.run_dir))
        overlay = Path(row.run_dir) / "view" / "overlay.mp4"
        return _Found(
            frames=int(record["video"]["num_frames"]),
            shots=len(record["shots"]),
            people=len(record["people"]),
            warnings=tuple(str(warning) for warning in record["warnings"]),
            overlay=str(overlay) if overlay.is_file() else "",
        )
    except InputError as error:
        told = f"its run folder is on {row.host}" if row.is_elsewhere else f"its run folder cannot be read: {error}"
        return _Found(warnings=(told,))
    except (KeyError, TypeError, ValueError) as error:
        return _Found(warnings=(f"its run folder cannot be read: {error}",))


def _as_csv(lines: Sequence[tuple[VideoRow, _Found]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for row, found in lines:
        writer.writerow(
            [
                row.video, row.state, row.stage or "", row.reason, found.frames, found.shots, found.people,
                "" if row.seconds is None else row.seconds, len(found.warnings), row.attempt, row.run_dir,
                found.overlay,
            ]
        )  # fmt: skip
    return text.getvalue()


def _as_html(name: str, lines: Sequence[tuple[VideoRow, _Found]], folder: Path) -> str:
    title = html.escape(f"batch {name}")
    summary = ", ".join(f"{number} {state}" for state, number in counts([row for row, _ in lines]).items())
    head = "".join(f"<th>{column}</th>" for column in COLUMNS if column != "run_dir")
    body = "\n".join(_html_row(row, found, folder) for row, found in lines)
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f"<style>{_STYLE}</style></head>\n<body><h1>{title}</h1><p>{len(lines)} videos: {summary}</p>\n"
        f"<table><thead><tr>{head}</tr></thead><tbody>\n{body}\n</tbody></table></body></html>\n"
    )


def _html_row(row: VideoRow, found: _Found, folder: Path) -> str:
    seconds = "" if row.seconds is None else f"{row.seconds:.1f}"
    has_folder = found != _Found()
    video = html.escape(Path(row.video).name)
    shown = f'<a href="{_link(row.run_dir, folder)}">{video}</a>' if has_folder else video
    overlay = f'<a href="{_link(found.overlay, folder)}">overlay</a>' if found.overlay else ""
    warnings = f'<span title="{html.escape("; ".join(found.warnings))}">{len(found.warnings)}</span>'
    figures = (found.frames, found.shots, found.people, seconds)
    numbers = "".join(f'<td class="number">{value}</td>' for value in figures)
    return (
        f'<tr><td title="{html.escape(row.video)}">{shown}</td><td class="{row.state}">{row.state}</td>'
        f"<td>{html.escape(row.stage or '')}</td><td>{html.escape(row.reason)}</td>{numbers}"
        f'<td class="number">{warnings}</td><td class="number">{row.attempt}</td><td>{overlay}</td></tr>'
    )


def _link(path: str, folder: Path) -> str:
    """Relative, so that runs and report can be moved together."""
    return html.escape(quote(os.path.relpath(path, folder.absolute())))


def _put(path: Path, text: str) -> None:
    replace_file(path, lambda fresh: _write(fresh, text))


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", errors="backslashreplace")
