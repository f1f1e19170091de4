"""`humanmm batch`: many videos, submitted once, watched, tried again, cancelled, reported."""

import contextlib
import signal
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from typer import Argument, Option

from humanmm.cli.settings import RunSettings, Settings
from humanmm.cli.terminal import say, write, write_all, write_json
from humanmm.cli.verb import BATCHES, Force, Json, Limit, StageName, Store, app, group, verb
from humanmm.errors import InputError, UsageError

if TYPE_CHECKING:
    from humanmm.storage.batches.batch_table import BatchTable
    from humanmm.storage.batches.video_row import VideoRow
    from humanmm.tasks.batches.request import BatchRequest

PARTIAL = 3

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
    hands: Annotated[bool, Option("--hands", help="look at everybody's hands as well")] = False
    priority: Annotated[Literal["high", "normal", "low"], Option(help="of videos that name none")] = "normal"
    tag: Annotated[list[str], Option(metavar="TAG", help="on every flow run; may be repeated")] = field(
        default_factory=list
    )
    watch: Annotated[bool, Option("--watch", help="stay, and take new videos once they stop growing")] = False
    schedule: Annotated[str | None, Option(metavar="CRON", help=_CRON)] = None
    settle: Annotated[float, Option(metavar="S", help=_SETTLE)] = 30.0
    wait: Wait = False
    dry_run: Annotated[bool, Option("--dry-run", help="list what would be scheduled and why; write nothing")] = False
    json: Json = False
    limit: Limit = None
    store: Store = None

    def request(self) -> "BatchRequest":
        """The batch that they describe."""
        from humanmm.tasks.batches.request import BatchRequest

        return BatchRequest(
            source=self.source, out=self.out, config=self.settings.config(**{"hands": True} if self.hands else {}),
            name=self.name, pattern=self.glob, priority=self.priority, tags=self.tag, settle_s=self.settle,
        )  # fmt: skip


@verb(batch, "submit")
def submit(options: Submission) -> int:
    """Schedule every video that is not finished; with --wait, wait until all have ended."""
    from humanmm.storage.batches.batch_table import open_batches
    from humanmm.storage.store.files import check_writable

    if options.watch and options.schedule is not None:
        raise UsageError("--watch and --schedule exclude each other")
    if options.json and (options.watch or options.schedule is not None):
        raise UsageError("--json goes with neither --watch nor --schedule")
    request, table = options.request(), open_batches(options.store, read_only=options.dry_run)
    if options.dry_run:
        return _write_plan(request, table, as_json=options.json)
    check_writable(options.out)
    if table.is_of_this_host:
        where = f"batches of {table.store.location} are kept on this host, in {table.path}"
        say(f"{where}; hosts that share the bucket need one database: set $HUMANMM_DATABASE_URL on each")
    if options.schedule is not None:
        return _set_schedule(table, request, options.schedule, options.limit)
    if options.watch:
        return _watch(table, request, options.limit)
    submission = request.submit(table, request.videos())
    say(f"batch {submission.name}: {submission.sentence}")
    to_do = submission.to_schedule
    return _run(table, submission.name, to_do, wait=options.wait, limit=options.limit, as_json=options.json)


@verb(batch, "status")
def status(
    name: BatchName = None,
    *,
    store: Store = None,
    one_by_one: Annotated[bool, Option("--list", help="a line a video: state, people, shots, warnings")] = False,
    json: Json = False,
) -> None:
    """Say how far a batch is: counts, speed, the newest failures, and the schedules that are set."""
    from humanmm.flows.service import batches
    from humanmm.storage.batches.batch_table import open_batches
    from humanmm.tasks.batches.status import status_lines, video_lines

    table = open_batches(store)
    known = table.names()
    timed = [one for one in batches.schedules(table.store.location) if name in (None, one.batch)]
    rows: Sequence[VideoRow] = ()
    if timed and not (name in known if name else known):
        name = timed[0].batch
    else:
        _, name, rows = _open(name, store)
    if json:
        return write_json(_as_tree(name, rows))
    write_all(video_lines(rows) if one_by_one else status_lines(name, rows))
    write_all(one.sentence for one in timed)
    if any(row.state == "scheduled" for row in rows) and not batches.is_served():
        write("no worker is running: start `humanmm serve`")
    return None


@verb(batch, "retry-failed")
def retry_failed(
    name: BatchName = None,
    *,
    settings: RunSettings,
    store: Store = None,
    stage: Annotated[StageName | None, Option(metavar="STAGE", help="only videos that failed in STAGE")] = None,
    wait: Wait = False,
    limit: Limit = None,
    json: Json = False,
) -> int:
    """Schedule again what failed, is partial or was cancelled. What the store has is not computed again.

    A video that is damaged, or that has nobody in it, is left out until its file is another.

    Limits given here, such as --run.limit_s, take the place of those that the videos had.
    """
    from humanmm.tasks.batches.batch import retry

    table, name, before = _open(name, store)
    hopeless = sum(row.fails_again for row in before)
    left = f"; {hopeless} are left out: their files are to blame, and are as they were" if hopeless else ""
    rows = retry(table, name, stage=stage, values=settings.values())
    say(f"batch {name}: {len(rows)} videos are tried again{left}")
    return _run(table, name, rows, wait=wait, limit=limit, as_json=json)


@verb(batch, "cancel")
def cancel(name: BatchName = None, *, store: Store = None) -> None:
    """Cancel the videos that wait, end those that run."""
    from humanmm.flows.service import batches

    table, name, _ = _open(name, store)
    cancelled = batches.cancel(table, name)
    running = [row for row in cancelled if row.state == "running"]
    ended = f"{len(cancelled)} videos cancelled, {len(running)} of them were running"
    elsewhere = sum(row.is_elsewhere for row in running)
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


def _write_plan(request: "BatchRequest", table: "BatchTable", *, as_json: bool) -> int:
    """Say what submitting would do, a line a video."""
    plan = request.forecast(table, request.videos())
    if as_json:
        write_json({"batch": request.batch, "videos": [one.to_json() for one in plan]})
        return 0
    width = max((len(one.row.video) for one in plan), default=0)
    write(*(f"{one.row.video:<{width}}  {one.sentence}" for one in plan))
    to_do = sum(one.state == "to do" for one in plan)
    say(f"batch {request.batch}: {to_do} of {len(plan)} videos would be scheduled; nothing was written")
    return 0


def _watch(table: "BatchTable", request: "BatchRequest", limit: int | None) -> int:
    """Submit videos as they come, until Ctrl-C or SIGTERM."""
    from humanmm.flows.service import batches

    signal.signal(signal.SIGTERM, signal.default_int_handler)
    say(f"batch {request.batch}: watching {request.source}")
    with contextlib.suppress(KeyboardInterrupt):
        for submission in batches.watch(request, table, limit=limit):
            say(f"batch {submission.name}: {submission.sentence}")
    return 0


def _set_schedule(table: "BatchTable", request: "BatchRequest", cron: str, limit: int | None) -> int:
    from humanmm.flows.service import batches

    following = batches.set_schedule(request, table.store.location, None if cron == "none" else cron, limit=limit)
    if following is None:
        say(f"batch {request.batch}: not on a schedule any more")
    else:
        say(f"batch {request.batch}: next at {following:%Y-%m-%d %H:%M %Z}, if `humanmm serve` runs then")
    write(request.batch)
    return 0


def _run(
    table: "BatchTable", name: str, rows: "Sequence[VideoRow]", *, wait: bool, limit: int | None, as_json: bool
) -> int:
    """Schedule these videos; with `wait`, say what became of the batch when it has ended."""
    from humanmm.flows.service import batches
    from humanmm.progress import counted
    from humanmm.storage.batches.video_row import counts_in_words

    with counted(f"scheduling {len(rows):,} videos") as progress:
        batches.schedule(table, rows, limit=limit, progress=progress)
    ended = batches.wait(table, name, limit=limit) if wait else []
    if as_json:
        write_json(_as_tree(name, ended or table.rows(name)) | {"scheduled": [row.video for row in rows]})
    else:
        write(name)
    if not wait:
        return 0
    say(f"batch {name}: {counts_in_words(ended)}")
    unfinished = [row for row in ended if row.state != "done"]
    for row in unfinished:
        say(f"{row.video}: {row.state}: {row.reason}")
    return PARTIAL if unfinished else 0


def _as_tree(name: str, rows: "Sequence[VideoRow]") -> dict[str, Any]:
    """A batch as `--json` prints it."""
    from humanmm.storage.batches.video_row import counts

    return {"batch": name, "counts": counts(rows), "videos": [row.to_json() for row in rows]}


def _open(name: str | None, store: Path | None) -> "tuple[BatchTable, str, list[VideoRow]]":
    """A batch by its name, and its videos; those whose process was lost are found first."""
    from humanmm.storage.batches.batch_table import open_batches
    from humanmm.tasks.batches.batch import with_notes

    table = open_batches(store)
    name = table.check(name) if name else table.newest()
    table.find_lost(name)
    return table, name, with_notes(table, table.rows(name))
