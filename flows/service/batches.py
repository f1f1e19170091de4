"""What `humanmm batch` has the service do: schedule videos, follow a folder, wait for the end, cancel.

Prefect is imported when its server is up: it reads the server's address as it is imported.
"""

import contextlib
import logging
import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

import httpx

from humanmm.errors import UsageError
from humanmm.flows.server.local_server import prefect_server, running_server, server_files
from humanmm.flows.service.serve import bring_up, is_serving
from humanmm.storage.batches.batch_table import BatchTable
from humanmm.storage.batches.manifest import videos_in
from humanmm.storage.batches.video_row import VideoRow
from humanmm.tasks.batches.batch import Submission
from humanmm.tasks.batches.request import BatchRequest
from humanmm.tasks.batches.watch import Settled

if TYPE_CHECKING:
    from humanmm.flows.server.flow_runs import Timed

IDLE_S = 120.0
"""A `humanmm serve` that a batch brought up ends after so many seconds without work."""
POLL_S = 1.0
LOOK_AFTER_S = 10.0
CANCEL_LIMIT_S = 10.0
LOCALTIME = Path("/etc/localtime")

log = logging.getLogger(__name__)


def schedule(
    table: BatchTable,
    rows: Sequence[VideoRow],
    *,
    limit: int | None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> None:
    """Create the flow runs of these videos; start `humanmm serve` if none runs, with `limit` videos at a time.

    `progress` is called with the videos done and all videos.
    """
    if not rows:
        return
    bring_up(limit=limit, idle_s=IDLE_S)
    with prefect_server():
        from humanmm.flows.server import flow_runs

        flow_runs.schedule(table, rows, progress=progress)


def set_schedule(request: BatchRequest, store: str, cron: str | None, *, limit: int | None) -> datetime | None:
    """Submit the batch at the times of a cron line, in this machine's time zone; None ends that. Returns the next.

    InputError for a source that is not there; that a folder holds no video yet is none.
    """
    if cron is not None and not request.source.is_dir():
        request.videos()
    parameters = {
        "source": str(request.source.absolute()), "out": str(request.out.absolute()), "store": store,
        "config": request.config.model_dump(mode="json"), "pattern": request.pattern, "priority": request.priority,
        "tags": list(request.tags), "settle_s": request.settle_s,
    }  # fmt: skip
    bring_up(limit=limit, idle_s=IDLE_S)
    with prefect_server():
        from humanmm.flows.server import flow_runs

        return flow_runs.set_schedule(request.batch, cron, _timezone(), parameters)


def schedules(store: str) -> "list[Timed]":
    """The schedules of a store's batches, as a server that is up knows them: none fires while it is down."""
    if not _has_server():
        return []
    with prefect_server():
        from humanmm.flows.server import flow_runs

        try:
            return flow_runs.schedules(store)
        except httpx.HTTPError as error:
            log.info("the Prefect server did not respond: %s", error)
            return []


def is_served() -> bool:
    """Whether somebody computes what waits: `humanmm serve` here, or perhaps workers of the user's own server."""
    return bool(os.environ.get("PREFECT_API_URL")) or is_serving(server_files())


def _has_server() -> bool:
    return bool(os.environ.get("PREFECT_API_URL") or running_server(server_files()))


def _timezone() -> str:
    """The machine's time zone by its name; UTC, with a warning, where it has none that is known."""
    asked = os.environ.get("TZ", "").lstrip(":")
    named = asked or str(LOCALTIME.resolve())
    name = named.rpartition("zoneinfo/")[2]
    try:
        return ZoneInfo(name).key
    except (ValueError, OSError, ZoneInfoNotFoundError):
        if asked or LOCALTIME.exists():
            said = f"TZ = {asked!r} is" if asked else f"{named} is"
            log.warning("%s no named time zone such as Europe/Berlin: the schedule's times are UTC", said)
        return "UTC"


def watch(request: BatchRequest, table: BatchTable, *, limit: int | None) -> Iterator[Submission]:
    """Submit again whenever a video has come or changed, and stopped growing; each submission. Never ends by itself.

    A video that changes while it is running is submitted when that has ended.
    """
    if not request.source.is_dir():
        raise UsageError(f"--watch: {request.source} is no folder")
    settled, taken = Settled(request.settle_s), dict[Path, str]()
    while True:
        found = videos_in(request.source, pattern=request.pattern)
        quiet = settled.look(found, time.monotonic())
        changed = {str(video) for video, facts in quiet.items() if taken.get(video) != facts}
        if changed and changed - {row.video for row in table.rows(request.batch, "running")}:
            submission = request.submit(table, [entry for entry in found if entry.video in quiet])
            yield submission
            schedule(table, submission.to_schedule, limit=limit)
            taken = {video: facts for video, facts in quiet.items() if str(video) not in submission.outdated}
        time.sleep(min(max(request.settle_s / 5, 0.2), 5.0))


def wait(table: BatchTable, name: str, *, limit: int | None) -> list[VideoRow]:
    """The rows of a batch when every video has ended.

    Should `humanmm serve` have ended, another one is started, and videos that wait are scheduled again.
    """
    looked = time.monotonic()
    while True:
        lost = table.find_lost(name)
        waiting = table.rows(name, "scheduled", "running")
        if not lost and not waiting:
            return table.rows(name)
        time.sleep(POLL_S)
        if time.monotonic() - looked > LOOK_AFTER_S:
            looked = time.monotonic()
            if not is_serving(server_files()):
                schedule(table, [row for row in waiting if row.state == "scheduled"], limit=limit)


def cancel(table: BatchTable, name: str) -> list[VideoRow]:
    """Cancel what waits, end the processes of what runs here; the rows that were cancelled, as they were before.

    A process on another machine ends when it next renews its lease.
    """
    open_states = ("scheduled", "running")
    cancelled = [
        row
        for row in table.rows(name, *open_states)
        if table.change(row, only_from=open_states, state="cancelled", reason="humanmm batch cancel")
    ]
    running = [row for row in cancelled if row.state == "running"]
    for number in (signal.SIGTERM, signal.SIGKILL):
        for row in running:
            if row.pid:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(row.pid, number)
        deadline = time.monotonic() + CANCEL_LIMIT_S
        while time.monotonic() < deadline and any(row.pid for row in running):
            time.sleep(0.1)
    if cancelled and _has_server():
        with prefect_server():
            from humanmm.flows.server import flow_runs

            flow_runs.cancel([table.row(name, row.video) or row for row in cancelled])
    return cancelled
