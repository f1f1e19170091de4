"""`humanmm batch`: many videos, submitted once, watched, tried again, cancelled, reported."""

import contextlib
import os
import signal
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from typer import Argument, Option

from humanmm.cli.settings import Settings
from humanmm.cli.terminal import say, write, write_all, write_json
from humanmm.cli.verb import BATCHES, STAGES, Force, Json, Limit, StageName, Store, app, group, verb
from humanmm.errors import InputError, UsageError

if TYPE_CHECKING:
    from humanmm.config import Config
    from humanmm.storage.batches.batch_table import BatchTable
    from humanmm.storage.batches.manifest import Entry
    from humanmm.storage.batches.video_row import VideoRow

PARTIAL = 3
IDLE_S = 120.0
"""A `humanmm serve` that a batch brought up leaves after so many seconds without work."""
POLL_S = 1.0
LOOK_AFTER_S = 10.0
CANCEL_LIMIT_S = 10.0

BatchName = Annotated[str | None, Argument(metavar="NAME", help="name of the batch (default: the newest)")]
Wait = Annotated[bool, Option("--wait", help="return when every video has ended; exit status 3 unless all are done")]
batch = group("Many videos: submit, status, retry-failed, cancel, report.")
app.add_typer(batch, name="batch", rich_help_panel=BATCHES)

_CRON = "submit it at such times while `humanmm serve` runs, e.g. '0 2 * * *'; `none` ends that"
_SETTLE = "with --watch or --schedule: leave files alone that changed in the last S seconds"


@dataclass(frozen=True, kw_only=True)
class Submission:
    """The options of `batch submit`."""

    source: Annotated[Path, Argument(metavar="FOLDER|MANIFEST", help="a folder, a .csv or a .jsonl file")]
    settings: Settings
    name: Annotated[str | None, Option(help="name of the batch (default: made of the source)")] = None
    out: Annotated[Path, Option(metavar="DIR", help="where the run folders go")] = Path("runs")
    glob: Annotated[str | None, Option(metavar="PATTERN", help="only such names of a folder: 'cam1_*.mp4'")] = None
    priority: Annotated[Literal["high", "normal", "low"], Option(help="of videos that name none")] = "normal"
    tag: Annotated[list[str], Option(metavar="TAG", help="on every flow run; may be repeated")] = field(
        default_factory=list
    )
    watch: Annotated[bool, Option("--watch", help="stay, and take new videos once they stop growing")] = False
    schedule: Annotated[str | None, Option(metavar="CRON", help=_CRON)] = None
    settle: Annotated[float, Option(metavar="S", help=_SETTLE)] = 30.0
    wait: Wait = False
    limit: Limit = None
    store: Store = None


@verb(batch, "submit")
def submit(options: Submission) -> int:
    """Schedule every video that is not finished; with --wait, see the batch through."""
    from humanmm.recovery import check_writable
    from humanmm.storage.batches.manifest import read_batch
    from humanmm.storage.store.bucket import is_bucket
    from humanmm.tasks.batches import batch as batches

    if options.watch and options.schedule is not None:
        raise UsageError("--watch and --schedule exclude each other")
    config = options.settings.config()
    check_writable(options.out)
    table = _table(options.store)
    if table.path is not None and is_bucket(table.store.location):
        where = f"batches of {table.store.location} are kept on this host, in {table.path}"
        say(f"{where}; hosts that share the bucket need one database: set $HUMANMM_DATABASE_URL on each")
    name = options.name or batches.batch_name(options.source)
    if options.schedule is not None:
        return _set_schedule(table, name, config, options)
    if options.watch:
        return _watch(table, name, config, options)
    entries = _with_defaults(read_batch(options.source, pattern=options.glob), options)
    submission = batches.submit(table, name, entries, config, options.out)
    counted = f"{len(submission.to_schedule)} to do, {submission.finished} finished"
    if submission.failed:
        counted += f", {submission.failed} failed or cancelled before (`humanmm batch retry-failed` tries them again)"
    say(f"batch {name}: {counted}")
    return _see_through(table, name, submission.to_schedule, wait=options.wait, limit=options.limit)


@verb(batch, "status")
def status(name: BatchName = None, *, store: Store = None, json: Json = False) -> None:
    """Say how far a batch is: counts, speed, and the newest failures."""
    from humanmm.storage.batches.video_row import counts

    _, name, rows = _open(name, store)
    if json:
        return write_json({"batch": name, "counts": counts(rows), "videos": [row.to_json() for row in rows]})
    write(f"batch {name}: {len(rows)} videos, {_counted(rows)}", *_speed(rows), *_by_stage(rows))
    bad = sorted((row for row in rows if row.state in ("failed", "partial")), key=lambda row: -row.changed)
    write_all(f"  {row.state}: {row.video} ({row.stage or 'no stage'}): {row.reason}" for row in bad[:10])
    if len(bad) > 10:
        write(f"  and {len(bad) - 10} more")
    return None


@verb(batch, "retry-failed")
def retry_failed(
    name: BatchName = None,
    *,
    store: Store = None,
    stage: Annotated[StageName | None, Option(metavar="STAGE", help="only videos that failed in STAGE")] = None,
    wait: Wait = False,
    limit: Limit = None,
) -> int:
    """Schedule what failed, is partial or was cancelled. What the store has is not computed again."""
    from humanmm.tasks.batches import batch as batches

    table, name, _ = _open(name, store)
    rows = batches.retry(table, name, stage=stage)
    say(f"batch {name}: {len(rows)} videos are tried again")
    return _see_through(table, name, rows, wait=wait, limit=limit)


@verb(batch, "cancel")
def cancel(name: BatchName = None, *, store: Store = None) -> None:
    """Cancel what waits, stop what runs."""
    table, name, _ = _open(name, store)
    cancelled = [
        row
        for row in table.rows(name, "scheduled", "running")
        if table.change(row, only_from=("scheduled", "running"), state="cancelled", reason="humanmm batch cancel")
    ]
    running = [row for row in cancelled if row.state == "running" and row.pid]
    for number in (signal.SIGTERM, signal.SIGKILL):
        for row in running:
            if row.pid:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(row.pid, number)
        deadline = time.monotonic() + CANCEL_LIMIT_S
        while time.monotonic() < deadline and any(row.pid for row in running):
            time.sleep(0.1)
    from humanmm.flows.server.local_server import prefect_server, running_server, server_files

    if cancelled and (os.environ.get("PREFECT_API_URL") or running_server(server_files())):
        with prefect_server():
            from humanmm.flows.server.flow_runs import cancel as cancel_flow_runs

            cancel_flow_runs([table.row(name, row.video) or row for row in cancelled])
    ended = f"{len(cancelled)} videos cancelled, {len(running)} of them were running"
    elsewhere = sum(row.state == "running" and row.is_elsewhere for row in cancelled)
    say(f"batch {name}: {ended}" + (f"; {elsewhere} on other machines end within a minute" if elsewhere else ""))


@verb(batch, "report")
def report(
    name: BatchName = None,
    *,
    store: Store = None,
    out: Annotated[Path | None, Option(metavar="DIR", help="where to (default: batch-<name>)")] = None,
    force: Force = False,
) -> None:
    """Write a table of all videos: report.html and report.csv."""
    from humanmm.storage.pages.batch_report import write_report

    _, name, rows = _open(name, store)
    folder = out or Path(f"batch-{name}")
    if (folder / "report.html").exists() and not force:
        raise InputError(f"{folder / 'report.html'} exists already; give --force to replace it")
    write(*write_report(folder, name, rows))


# ---- a batch that goes on


def _with_defaults(entries: "Sequence[Entry]", options: Submission) -> "list[Entry]":
    return [entry.with_defaults(priority=options.priority, tags=options.tag) for entry in entries]


def _watch(table: "BatchTable", name: str, config: "Config", options: Submission) -> int:
    """Submit again whenever a video has come or changed, and stopped growing; until Ctrl-C or SIGTERM."""
    from humanmm.storage.batches.manifest import videos_in
    from humanmm.tasks.batches import batch as batches
    from humanmm.tasks.batches.watch import Settled

    if not options.source.is_dir():
        raise UsageError(f"--watch: {options.source} is no folder")
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    settled, taken = Settled(options.settle), dict[Path, str]()
    say(f"batch {name}: watching {options.source}")
    with contextlib.suppress(KeyboardInterrupt):
        while True:
            found = videos_in(options.source, pattern=options.glob)
            quiet = settled.look(found, time.monotonic())
            if not quiet.items() <= taken.items():
                entries = _with_defaults([entry for entry in found if entry.video in quiet], options)
                submission = batches.submit(table, name, entries, config, options.out)
                say(f"batch {name}: {len(submission.to_schedule)} to do, {submission.finished} finished")
                if submission.to_schedule:
                    _schedule(table, submission.to_schedule, options.limit)
                taken = quiet
            time.sleep(min(max(options.settle / 5, 0.2), 5.0))
    return 0


def _set_schedule(table: "BatchTable", name: str, config: "Config", options: Submission) -> int:
    from humanmm.flows.server.local_server import prefect_server
    from humanmm.flows.service.serve import bring_up

    cron = None if options.schedule == "none" else options.schedule
    parameters = {
        "source": str(options.source.absolute()), "out": str(options.out.absolute()), "store": table.store.location,
        "config": config.model_dump(mode="json"), "pattern": options.glob, "priority": options.priority,
        "tags": options.tag, "settle_s": options.settle,
    }  # fmt: skip
    bring_up(limit=options.limit, idle_s=IDLE_S)
    with prefect_server():
        from humanmm.flows.server.flow_runs import set_schedule

        following = set_schedule(name, cron, _timezone(), parameters)
    if following is None:
        say(f"batch {name}: not on a schedule any more")
    else:
        say(f"batch {name}: next at {following:%Y-%m-%d %H:%M %Z}, if `humanmm serve` runs then")
    write(name)
    return 0


def _timezone() -> str:
    """The machine's time zone by its name."""
    named = os.environ.get("TZ") or str(Path("/etc/localtime").resolve()).partition("zoneinfo/")[2]
    return named if named.lstrip(":") and (Path("/usr/share/zoneinfo") / named).is_file() else "UTC"


# ---- seeing a batch through


def _see_through(table: "BatchTable", name: str, rows: "Sequence[VideoRow]", *, wait: bool, limit: int | None) -> int:
    if rows:
        _schedule(table, rows, limit)
    if wait:
        _wait(table, name, limit)
    write(name)
    if not wait:
        return 0
    ended = table.rows(name)
    say(f"batch {name}: {_counted(ended)}")
    for row in ended:
        if row.state != "done":
            say(f"{row.video}: {row.state}: {row.reason}")
    return 0 if all(row.state == "done" for row in ended) else PARTIAL


def _schedule(table: "BatchTable", rows: "Sequence[VideoRow]", limit: int | None) -> None:
    from humanmm.flows.server.local_server import prefect_server
    from humanmm.flows.service.serve import bring_up

    bring_up(limit=limit, idle_s=IDLE_S)
    with prefect_server():
        from humanmm.flows.server.flow_runs import schedule

        schedule(table, rows)


def _wait(table: "BatchTable", name: str, limit: int | None) -> None:
    """Until every video has ended. Should `humanmm serve` be gone, it is started again, and what it lost scheduled."""
    from humanmm.flows.server.local_server import server_files
    from humanmm.flows.service.serve import is_serving

    looked = time.monotonic()
    while table.find_lost(name) or (waiting := table.rows(name, "scheduled", "running")):
        time.sleep(POLL_S)
        if time.monotonic() - looked > LOOK_AFTER_S:
            looked = time.monotonic()
            if not is_serving(server_files()):
                _schedule(table, [row for row in waiting if row.state == "scheduled"], limit)


def _speed(rows: "Sequence[VideoRow]") -> list[str]:
    """Videos an hour, from the last ten that ended, and the time left at that speed."""
    waiting = sum(row.state in ("scheduled", "running") for row in rows)
    ended = sorted((row for row in rows if row.seconds and row.state in ("done", "partial")), key=lambda r: r.changed)
    recent = ended[-10:]
    if not recent:
        return []
    mean_s = sum(row.seconds or 0.0 for row in recent) / len(recent)
    line = f"  {mean_s:.1f} s a video"
    running = sum(row.state == "running" for row in rows)
    if waiting and running:
        line += f", {3600 * running / mean_s:.0f} videos an hour, about {waiting * mean_s / running / 60:.0f} min left"
    return [line]


def _by_stage(rows: "Sequence[VideoRow]") -> list[str]:
    """How many videos are running, partial or failed at which stage, in the order of the stages."""
    lines = []
    for state in ("running", "partial", "failed"):
        stages = [(row.stage or "no stage").split(" · ")[0] for row in rows if row.state == state]
        known = sorted(set(stages), key=lambda name: (STAGES.index(name) if name in STAGES else len(STAGES), name))
        if stages:
            lines.append(f"  {state}: " + ", ".join(f"{stages.count(name)} in {name}" for name in known))
    return lines


def _counted(rows: "Sequence[VideoRow]") -> str:
    from humanmm.storage.batches.video_row import counts

    return ", ".join(f"{number} {state}" for state, number in counts(rows).items()) or "nothing in it"


def _open(name: str | None, store: Path | None) -> "tuple[BatchTable, str, list[VideoRow]]":
    """A batch by its name, and its videos; those whose process was lost are found first."""
    table = _table(store)
    name = table.check(name) if name else table.newest()
    table.find_lost(name)
    return table, name, list(table.rows(name))


def _table(store: Path | None) -> "BatchTable":
    from humanmm.storage.batches.batch_table import open_batches
    from humanmm.storage.store.store import default_store

    return open_batches(store or default_store())
