"""`humanmm batch`: many videos, submitted once, watched, tried again, cancelled, reported."""

import argparse
import contextlib
import json
import os
import signal
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from humanmm.cli.recover import check_writable
from humanmm.cli.settings import UsageError, add_settings, load_config
from humanmm.config import Config
from humanmm.storage.batches.batch_ledger import BatchLedger, VideoRow, counts
from humanmm.storage.batches.manifest import Entry
from humanmm.storage.store.open import open_ledger
from humanmm.storage.store.store import default_store
from humanmm.tasks import pipeline

PARTIAL = 3
IDLE_S = 120.0
"""A `humanmm serve` that a batch brought up leaves after so many seconds without work."""
POLL_S = 1.0
LOOK_AFTER_S = 10.0
CANCEL_LIMIT_S = 10.0


def add_batch(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Declare `batch submit|status|retry-failed|cancel|report`."""
    parser = verbs.add_parser("batch", help="many videos: submit, status, retry-failed, cancel, report")
    inner = parser.add_subparsers(required=True, metavar="submit|status|retry-failed|cancel|report")

    submitting = inner.add_parser(
        "submit", parents=[common], allow_abbrev=False, help="schedule every video that is not finished"
    )
    submitting.add_argument("source", type=Path, metavar="FOLDER|MANIFEST", help="a folder, a .csv or a .jsonl file")
    submitting.add_argument("--name", help="name of the batch (default: made of the source)")
    submitting.add_argument("--out", type=Path, default=Path("runs"), metavar="DIR", help="run folders (default: runs)")
    submitting.add_argument("--glob", metavar="PATTERN", help="of a folder, only such names, e.g. 'cam1_*.mp4'")
    submitting.add_argument("--priority", choices=("high", "normal", "low"), help="of videos that name none")
    submitting.add_argument("--tag", action="append", default=[], metavar="TAG", help="a tag on every flow run")
    how = submitting.add_mutually_exclusive_group()
    how.add_argument(
        "--watch", action="store_true", help="stay, and take new videos of a folder once they stop growing"
    )
    how.add_argument(
        "--schedule",
        metavar="CRON",
        help="submit it at such times while `humanmm serve` runs, e.g. '0 2 * * *'; or none",
    )
    submitting.add_argument(
        "--settle", type=float, default=30.0, metavar="S",
        help="with --watch or --schedule, leave files alone that changed in the last S seconds (default: 30)",
    )  # fmt: skip
    _add_waiting(submitting)
    _add_store(submitting)
    add_settings(submitting)
    submitting.set_defaults(run=submit)

    watching = inner.add_parser("status", parents=[common], allow_abbrev=False, help="how far a batch is")
    _add_batch(watching)
    watching.add_argument("--json", action="store_true", help="one json object")
    watching.set_defaults(run=status)

    retrying = inner.add_parser(
        "retry-failed", parents=[common], allow_abbrev=False, help="schedule what failed, is partial or was cancelled"
    )
    _add_batch(retrying)
    names = [stage.name for stage in pipeline.STAGES]
    retrying.add_argument("--stage", choices=names, metavar="STAGE", help="only videos that failed in STAGE")
    _add_waiting(retrying)
    retrying.set_defaults(run=retry_failed)

    cancelling = inner.add_parser("cancel", parents=[common], allow_abbrev=False, help="stop what waits or runs")
    _add_batch(cancelling)
    cancelling.set_defaults(run=cancel)

    reporting = inner.add_parser("report", parents=[common], allow_abbrev=False, help="a table: HTML and CSV")
    _add_batch(reporting)
    reporting.add_argument("--out", type=Path, metavar="DIR", help="where to (default: batch-<name>)")
    reporting.add_argument("--force", action="store_true", help="replace a report that exists")
    reporting.set_defaults(run=report)


VERBS = (add_batch,)


def submit(options: argparse.Namespace) -> int:
    """Write the batch down, schedule what is not finished; with --wait, see it through."""
    from humanmm.storage.batches.manifest import read_batch
    from humanmm.tasks.batches import batch as batches

    _check_limit(options)
    config = load_config(options)
    check_writable(options.out)
    ledger = _ledger(options)
    name = options.name or batches.batch_name(options.source)
    if options.schedule is not None:
        return _set_schedule(ledger, name, config, options)
    if options.watch:
        return _watch(ledger, name, config, options)
    entries = _with_defaults(read_batch(options.source, pattern=options.glob), options)
    submission = batches.submit(ledger, name, options.source, entries, config, options.out)
    told = f"{len(submission.to_schedule)} to do, {submission.finished} finished"
    if submission.failed:
        told += f", {submission.failed} failed or cancelled before (`humanmm batch retry-failed` tries them again)"
    _say(f"batch {name}: {told}")
    return _see_through(ledger, name, submission.to_schedule, options)


def status(options: argparse.Namespace) -> int:
    """Counts, speed and the newest failures; or everything as json."""
    ledger, name = _open(options)
    ledger.find_lost(name)
    rows = ledger.rows(name)
    if options.json:
        tree = {"batch": name, "counts": counts(rows), "videos": [row.to_json() for row in rows]}
        sys.stdout.write(json.dumps(tree, indent=1) + "\n")
        return 0
    _print([f"batch {name}: {len(rows)} videos, {_counted(rows)}", *_speed(rows), *_by_stage(rows)])
    bad = sorted((row for row in rows if row.state in ("failed", "partial")), key=lambda row: -row.changed)
    _print([f"  {row.state}: {row.video} ({row.stage or 'no stage'}): {row.reason}" for row in bad[:10]])
    if len(bad) > 10:
        _print([f"  and {len(bad) - 10} more"])
    return 0


def retry_failed(options: argparse.Namespace) -> int:
    """A new attempt at what did not end well; what the store has is not computed again."""
    from humanmm.tasks.batches import batch as batches

    _check_limit(options)
    ledger, name = _open(options)
    ledger.find_lost(name)
    rows = batches.retry(ledger, name, stage=options.stage)
    _say(f"batch {name}: {len(rows)} videos are tried again")
    return _see_through(ledger, name, rows, options)


def cancel(options: argparse.Namespace) -> int:
    """Cancel what waits, stop what runs."""
    ledger, name = _open(options)
    ledger.find_lost(name)
    cancelled = [
        row
        for row in ledger.rows(name, "scheduled", "running")
        if ledger.change(row, only_from=("scheduled", "running"), state="cancelled", reason="humanmm batch cancel")
    ]
    running = [row for row in cancelled if row.state == "running" and row.pid and not row.is_elsewhere]
    for number in (signal.SIGTERM, signal.SIGKILL):
        for row in running:
            if ledger.is_held(row):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(row.pid or 0, number)
        deadline = time.monotonic() + CANCEL_LIMIT_S
        while time.monotonic() < deadline and any(ledger.is_held(row) for row in running):
            time.sleep(0.1)
    from humanmm.flows.server.local_server import prefect_server, running_server, server_files

    if cancelled and (os.environ.get("PREFECT_API_URL") or running_server(server_files())):
        with prefect_server():
            from humanmm.flows.server.flow_runs import cancel as cancel_flow_runs

            cancel_flow_runs(ledger, [ledger.row(name, row.video) or row for row in cancelled])
    told = f"{len(cancelled)} videos cancelled, {len(running)} of them were running"
    elsewhere = sum(row.state == "running" and row.is_elsewhere for row in cancelled)
    _say(f"batch {name}: {told}" + (f"; {elsewhere} on other machines end within a minute" if elsewhere else ""))
    return 0


def report(options: argparse.Namespace) -> int:
    """Write report.html and report.csv."""
    from humanmm.errors import InputError
    from humanmm.storage.pages.batch_report import write_report

    ledger, name = _open(options)
    ledger.find_lost(name)
    folder = options.out or Path(f"batch-{name}")
    if (folder / "report.html").exists() and not options.force:
        raise InputError(f"{folder / 'report.html'} exists already; give --force to replace it")
    for path in write_report(folder, name, ledger.rows(name)):
        sys.stdout.write(f"{path}\n")
    return 0


# ---- a batch that goes on


def _with_defaults(entries: Sequence[Entry], options: argparse.Namespace) -> list[Entry]:
    return [entry.with_defaults(priority=options.priority or "normal", tags=options.tag) for entry in entries]


def _watch(ledger: BatchLedger, name: str, config: Config, options: argparse.Namespace) -> int:
    """Submit again whenever a video has come or changed, and stopped growing; until Ctrl-C or SIGTERM."""
    from humanmm.storage.batches.manifest import videos_in
    from humanmm.tasks.batches import batch as batches
    from humanmm.tasks.batches.watch import Settled

    if not options.source.is_dir():
        raise UsageError(f"--watch: {options.source} is no folder")
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    settled, taken = Settled(options.settle), dict[Path, str]()
    _say(f"batch {name}: watching {options.source}")
    with contextlib.suppress(KeyboardInterrupt):
        while True:
            found = videos_in(options.source, pattern=options.glob)
            quiet = settled.look(found, time.monotonic())
            if not quiet.items() <= taken.items():
                entries = _with_defaults([entry for entry in found if entry.video in quiet], options)
                submission = batches.submit(ledger, name, options.source, entries, config, options.out)
                _say(f"batch {name}: {len(submission.to_schedule)} to do, {submission.finished} finished")
                if submission.to_schedule:
                    _schedule(ledger, submission.to_schedule, options.limit)
                taken = quiet
            time.sleep(min(max(options.settle / 5, 0.2), 5.0))
    return 0


def _set_schedule(ledger: BatchLedger, name: str, config: Config, options: argparse.Namespace) -> int:
    from humanmm.flows.server.local_server import prefect_server
    from humanmm.flows.service.serve import bring_up

    cron = None if options.schedule == "none" else options.schedule
    parameters = {
        "source": str(options.source.absolute()), "out": str(options.out.absolute()), "store": ledger.store.place,
        "config": config.model_dump(mode="json"), "pattern": options.glob, "priority": options.priority or "normal",
        "tags": options.tag, "settle_s": options.settle,
    }  # fmt: skip
    bring_up(limit=options.limit, idle_s=IDLE_S)
    with prefect_server():
        from humanmm.flows.server.flow_runs import set_schedule

        following = set_schedule(name, cron, _timezone(), parameters)
    if following is None:
        _say(f"batch {name}: not on a schedule any more")
    else:
        _say(f"batch {name}: next at {following:%Y-%m-%d %H:%M %Z}, if `humanmm serve` runs then")
    sys.stdout.write(f"{name}\n")
    return 0


def _timezone() -> str:
    """The machine's time zone by its name."""
    named = os.environ.get("TZ") or str(Path("/etc/localtime").resolve()).partition("zoneinfo/")[2]
    return named if named.lstrip(":") and (Path("/usr/share/zoneinfo") / named).is_file() else "UTC"


# ---- seeing a batch through


def _see_through(ledger: BatchLedger, name: str, rows: Sequence[VideoRow], options: argparse.Namespace) -> int:
    if rows:
        _schedule(ledger, rows, options.limit)
    if options.wait:
        _wait(ledger, name, options.limit)
    sys.stdout.write(f"{name}\n")
    if not options.wait:
        return 0
    ended = ledger.rows(name)
    _say(f"batch {name}: {_counted(ended)}")
    for row in ended:
        if row.state != "done":
            _say(f"{row.video}: {row.state}: {row.reason}")
    return 0 if all(row.state == "done" for row in ended) else PARTIAL


def _schedule(ledger: BatchLedger, rows: Sequence[VideoRow], limit: int | None) -> None:
    from humanmm.flows.server.local_server import prefect_server
    from humanmm.flows.service.serve import bring_up

    bring_up(limit=limit, idle_s=IDLE_S)
    with prefect_server():
        from humanmm.flows.server.flow_runs import schedule

        schedule(ledger, rows)


def _wait(ledger: BatchLedger, name: str, limit: int | None) -> None:
    """Until every video has ended. Should `humanmm serve` be gone, it is started again, and what it lost scheduled."""
    from humanmm.flows.server.local_server import server_files
    from humanmm.flows.service.serve import is_serving

    looked = time.monotonic()
    while ledger.find_lost(name) or (waiting := ledger.rows(name, "scheduled", "running")):
        time.sleep(POLL_S)
        if time.monotonic() - looked > LOOK_AFTER_S:
            looked = time.monotonic()
            if not is_serving(server_files()):
                _schedule(ledger, [row for row in waiting if row.state == "scheduled"], limit)


def _speed(rows: Sequence[VideoRow]) -> list[str]:
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


def _by_stage(rows: Sequence[VideoRow]) -> list[str]:
    """How many videos are running, partial or failed at which stage, in the order of the stages."""
    order = [stage.name for stage in pipeline.STAGES]
    lines = []
    for state in ("running", "partial", "failed"):
        stages = [(row.stage or "no stage").split(" · ")[0] for row in rows if row.state == state]
        known = sorted(set(stages), key=lambda name: (order.index(name) if name in order else len(order), name))
        if stages:
            lines.append(f"  {state}: " + ", ".join(f"{stages.count(name)} in {name}" for name in known))
    return lines


def _counted(rows: Sequence[VideoRow]) -> str:
    return ", ".join(f"{number} {state}" for state, number in counts(rows).items()) or "nothing in it"


def _open(options: argparse.Namespace) -> tuple[BatchLedger, str]:
    ledger = _ledger(options)
    return ledger, ledger.check(options.batch) if options.batch else ledger.newest()


def _ledger(options: argparse.Namespace) -> BatchLedger:
    return open_ledger(options.store or default_store())


def _check_limit(options: argparse.Namespace) -> None:
    if options.limit is not None and options.limit < 1:
        raise UsageError(f"--limit {options.limit}: at least one video at a time is needed")


def _add_batch(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("batch", nargs="?", metavar="NAME", help="name of the batch (default: the newest)")
    _add_store(parser)


def _add_store(parser: argparse.ArgumentParser) -> None:
    place = "artifact store (default: $HUMANMM_STORE, ~/.cache/humanmm/store)"
    parser.add_argument("--store", type=Path, metavar="DIR|s3://…", help=place)


def _add_waiting(parser: argparse.ArgumentParser) -> None:
    ended = "return when every video has ended; status 3 unless all are done"
    parser.add_argument("--wait", action="store_true", help=ended)
    help_text = "videos at the same time, if `humanmm serve` is not up yet (default: half the processors)"
    parser.add_argument("--limit", type=int, metavar="N", help=help_text)


def _print(lines: Sequence[str]) -> None:
    sys.stdout.write("".join(f"{line}\n" for line in lines))


def _say(text: str) -> None:
    sys.stderr.write(f"humanmm: {' '.join(text.split())}\n")
