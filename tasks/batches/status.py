"""How far a batch is, in lines for people: counts, speed, and the stages at which videos are or have failed."""

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from humanmm.errors import InputError
from humanmm.storage.batches.video_row import VideoRow, counts
from humanmm.storage.run_folder.run_record import read_run_record
from humanmm.storage.run_folder.summary import one_line
from humanmm.tasks.pipeline import STAGES

SHOWN_FAILURES = 10
_RECENT = 10
MOST_READ = 2000
"""Of a larger batch the warnings are not counted here: reading so many run.json would take seconds."""


def status_lines(name: str, rows: Sequence[VideoRow]) -> Iterator[str]:
    """What `humanmm batch status` prints."""
    yield f"batch {name}: " + (f"{len(rows)} videos, {_counts(rows)}" if rows else "nothing submitted yet")
    yield from _speed(rows)
    yield from _by_stage(rows)
    bad = sorted((row for row in rows if row.state in ("failed", "partial")), key=lambda row: -row.changed)
    yield from (f"  {row.state}: {row.video} ({row.stage or 'no stage'}): {row.reason}" for row in bad[:SHOWN_FAILURES])
    if len(bad) > SHOWN_FAILURES:
        yield f"  and {len(bad) - SHOWN_FAILURES} more"
    noted = Counter(row.reason for row in rows if row.state == "done" and row.reason)
    yield from (f"  {number} done: {reason}" for reason, number in noted.items())


def video_lines(rows: Sequence[VideoRow]) -> Iterator[str]:
    """One line a video: `done: 2 people, 3 shots, 1 warning`, or where it is, or why it failed."""
    width = max((len(row.video) for row in rows), default=0)
    yield from (f"{row.video:<{width}}  {_sentence(row)}" for row in rows)


def _record(row: VideoRow) -> dict[str, Any] | None:
    """The run record of a video with a result; None where its run folder cannot be read from here."""
    if row.state not in ("done", "partial"):
        return None
    try:
        return read_run_record(Path(row.run_dir))
    except InputError:
        return None


def _sentence(row: VideoRow) -> str:
    record = _record(row)
    stage = None if row.state == "done" else row.stage
    parts = [one_line(record) if record else row.state, stage, row.reason]
    return ": ".join(part for part in parts if part)


def _counts(rows: Sequence[VideoRow]) -> str:
    """Such as `30 done (23 with warnings), 3 failed`."""
    done = [row for row in rows if row.state == "done"] if len(rows) <= MOST_READ else []
    doubtful = sum(bool((_record(row) or {}).get("warnings")) for row in done)
    noted = {"done": f" ({doubtful} with warnings)"} if doubtful else {}
    return ", ".join(f"{number} {state}{noted.get(state, '')}" for state, number in counts(rows).items())


def _speed(rows: Sequence[VideoRow]) -> Iterator[str]:
    """Videos an hour, from the last ten that ended, and the time left at that speed."""
    waiting = sum(row.state in ("scheduled", "running") for row in rows)
    running = sum(row.state == "running" for row in rows)
    ended = sorted((row for row in rows if row.seconds and row.state in ("done", "partial")), key=lambda r: r.changed)
    recent_s = [row.seconds or 0.0 for row in ended[-_RECENT:]]
    if recent_s:
        mean_s = sum(recent_s) / len(recent_s)
        line = f"  {mean_s:.1f} s a video"
        if running:
            left_min = waiting * mean_s / running / 60
            line += f", {3600 * running / mean_s:.0f} videos an hour, about {left_min:.0f} min left"
        yield line


def _by_stage(rows: Sequence[VideoRow]) -> Iterator[str]:
    """How many videos are running, partial or failed at which stage, in the order of the stages."""
    order = [stage.name for stage in STAGES]
    for state in ("running", "partial", "failed"):
        stages = [(row.stage or "no stage").split(" · ")[0] for row in rows if row.state == state]
        named = sorted(set(stages), key=lambda name: (order.index(name) if name in order else len(order), name))
        if stages:
            yield f"  {state}: " + ", ".join(f"{stages.count(name)} in {name}" for name in named)
