"""How far a batch is, in lines for people: counts, speed, and the stages at which videos are or have failed."""

from collections.abc import Iterator, Sequence

from humanmm.storage.batches.video_row import VideoRow, counts_in_words
from humanmm.tasks.pipeline import STAGES

SHOWN_FAILURES = 10
_RECENT = 10


def status_lines(name: str, rows: Sequence[VideoRow]) -> Iterator[str]:
    """What `humanmm batch status` prints."""
    yield f"batch {name}: {len(rows)} videos, {counts_in_words(rows)}"
    yield from _speed(rows)
    yield from _by_stage(rows)
    bad = sorted((row for row in rows if row.state in ("failed", "partial")), key=lambda row: -row.changed)
    yield from (f"  {row.state}: {row.video} ({row.stage or 'no stage'}): {row.reason}" for row in bad[:SHOWN_FAILURES])
    if len(bad) > SHOWN_FAILURES:
        yield f"  and {len(bad) - SHOWN_FAILURES} more"


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
