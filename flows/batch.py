"""Many videos: one Prefect flow run per video, each in a process of its own, so that a crash or a leak ends with it.

`recover_video` is `recover` with an account in the ledger of the store: what became of a video stands there, whatever
happens to Prefect's database. `recover_batch` writes a batch down and schedules its videos; the command line, the
dashboard and a schedule all come through here.
"""

import asyncio
import functools
import json
import logging
from collections.abc import Coroutine, Mapping, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, TypeVar
from uuid import UUID

import httpx
from prefect import flow, get_client
from prefect.client.orchestration import PrefectClient
from prefect.client.schemas.actions import DeploymentScheduleCreate
from prefect.client.schemas.objects import State
from prefect.client.schemas.schedules import CronSchedule
from prefect.exceptions import ObjectNotFound
from prefect.runtime import flow_run
from prefect.states import Cancelled, Completed, Failed, Scheduled

from humanmm.config import Config
from humanmm.errors import HumanMMError, InputError
from humanmm.flows.known_stores import note_store
from humanmm.flows.local_server import server_files
from humanmm.flows.recover import DEFAULTS, EVERYTHING, opened, recover
from humanmm.logs import kept_text, to_standard_error, wants_json
from humanmm.storage.batch_ledger import BatchLedger, VideoRow
from humanmm.storage.batch_manifest import read_batch
from humanmm.storage.opening import open_ledger
from humanmm.storage.store import default_store
from humanmm.tasks import batch as batches
from humanmm.tasks.engine import VideoRun
from humanmm.tasks.faults import in_words
from humanmm.tasks.selection import Selection
from humanmm.tasks.watch import is_quiet

log = logging.getLogger(__name__)
T = TypeVar("T")

POOL = "humanmm"
DEPLOYMENT = "recover-video/recover-video"
BATCH_DEPLOYMENT = "recover-batch/recover-batch"
STOP_ASKS_S = 5.0
"""How long one who is told to stop asks why: it is killed soon."""
AT_A_TIME = 2
"""Requests to Prefect's server that are under way at the same time: on SQLite more only wait for each other."""


def _video_name() -> str:
    return Path(flow_run.parameters.get("video", "video")).name[:100]


@flow(name="recover-video", flow_run_name=_video_name, persist_result=False)
def recover_video(
    video: Path,
    out: Path | None = None,
    config: Config = DEFAULTS,
    store: Path | None = None,
    selection: Selection = EVERYTHING,
    batch: str | None = None,
    attempt: int = 1,
) -> Any:
    """Recover one video into a run folder. As a video of a batch, keep the batch's ledger up to date."""
    if batch is None:
        return recover.fn(video, out, config, store, selection)
    ledger = open_ledger(store or default_store())
    row = batches.insist(lambda: ledger.row(batch, str(video)))
    if row is None or row.attempt != attempt:
        return Cancelled(message=f"batch {batch} no longer asks for attempt {attempt} at this video")
    account = batches.Account(ledger, row)
    with account.kept(str(flow_run.id)) as ready:
        if not ready:
            return Cancelled(message="it was cancelled, or another process is at work on it")
        return _accounted(account, video, out, config, store, selection)


def _accounted(
    account: batches.Account, video: Path, out: Path | None, config: Config, store: Path | None, selection: Selection
) -> Any:
    if wants_json():
        to_standard_error(verbose=False)
    text = kept_text()

    def watch(run: VideoRun) -> None:
        account.run = run
        run.watch(lambda work, done, total: None, log_text=text.getvalue)

    token = opened.set(watch)
    try:
        state: State[Any] = recover.fn(video, out, config, store, selection)
    except Exception as error:  # noted, then raised: this is the edge of the flow
        account.fail(error)
        if isinstance(error, HumanMMError):
            return Failed(message=in_words(error))
        raise
    except BaseException:
        _stopped(account)
        raise
    finally:
        opened.reset(token)
    if state.name == "Partial":
        account.end_partial(state.message or "")
    else:
        account.end("done", "")
    return state


def _stopped(account: batches.Account) -> None:
    """Its process was told to stop: cancelled from the dashboard, or else to be resumed by the next who runs flows."""
    try:
        with get_client(httpx_settings={"timeout": STOP_ASKS_S}, sync_client=True) as client:
            state = client.read_flow_run(UUID(account.flow_run)).state
        cancelled = state is not None and (state.is_cancelling() or state.is_cancelled())
    except Exception as error:  # the server may have been stopped first
        log.info("the Prefect server did not answer: %s", error)
        cancelled = False
    if cancelled:
        account.end("cancelled", "cancelled from the dashboard")
    else:
        again = "it was stopped, and resumes when `humanmm serve` runs"
        batches.insist(lambda: account.ledger.try_again(account.row, again))


@flow(name="recover-batch", flow_run_name="{source}", persist_result=False)
def recover_batch(
    source: Path,
    out: Path = Path("runs"),
    config: Config = DEFAULTS,
    store: Path | None = None,
    name: str | None = None,
    pattern: str | None = None,
    priority: str = "normal",
    tags: tuple[str, ...] = (),
    settle_s: float = 30.0,
) -> Any:
    """Schedule every video of a folder or manifest that is not finished; asked twice, nothing is scheduled twice.

    Files that were written to less than `settle_s` seconds ago wait for the next time: they may still be growing.
    """
    ledger = open_ledger(store or default_store())
    asked = read_batch(source, pattern=pattern)
    entries = [entry.with_defaults(priority=priority, tags=tags) for entry in asked if is_quiet(entry.video, settle_s)]
    submission = batches.submit(ledger, name or batches.batch_name(source), source, entries, config, out)
    schedule(ledger, submission.to_schedule)
    growing = len(asked) - len(entries)
    told = f"{submission.name}: {len(submission.to_schedule)} scheduled, {submission.finished} finished"
    told += f", {submission.failed} failed before" if submission.failed else ""
    return Completed(message=told + (f", {growing} still being written" if growing else ""))


# ---- between the ledger and Prefect


def schedule(ledger: BatchLedger, rows: Sequence[VideoRow]) -> None:
    """A flow run per video. A run that Prefect knows already, by batch, video and attempt, is not made again.

    A video whose process was lost waits a little, the longer the more often it was lost. What a busy server refuses
    stays in the ledger, and `humanmm serve` asks for it again at its next look.
    """
    note_store(server_files(), ledger.store.place)
    refused: list[Exception] = []

    async def schedule_all() -> None:
        async with get_client() as client:
            deployment = await client.read_deployment_by_name(DEPLOYMENT)

            async def one(row: VideoRow) -> None:
                now = ledger.row(row.batch, row.video)
                if now is None or (now.attempt, now.flow_run) != (row.attempt, row.flow_run):
                    return  # `humanmm serve` and who submits see the same videos waiting: the other was quicker
                try:
                    made = await client.create_flow_run_from_deployment(
                        deployment.id,
                        parameters=_parameters(row, ledger),
                        name=Path(row.video).name[:100],
                        tags=[f"batch:{row.batch}", *json.loads(row.tags)],
                        idempotency_key=f"{ledger.store.place}:{row.lock_key}:{row.attempt}",
                        work_queue_name=queue_of(row.priority),
                        state=Scheduled(scheduled_time=datetime.now(UTC) + timedelta(seconds=_pause_s(row))),
                    )
                except httpx.HTTPError as error:
                    refused.append(error)
                    return
                note = functools.partial(ledger.change, row, only_from=("scheduled",), flow_run=str(made.id))
                await asyncio.to_thread(note)

            await _some_at_a_time([one(row) for row in rows])

    asyncio.run(schedule_all())
    if refused:
        log.warning("%d videos wait until the Prefect server answers again (%s)", len(refused), in_words(refused[0]))


def set_schedule(name: str, cron: str | None, timezone: str, parameters: Mapping[str, Any]) -> datetime | None:
    """Have `recover_batch` run at the times of a cron line, in place of what `name` had before; None ends it.

    Returns when it is next. InputError for a line that is none.
    """
    from prefect.server.schemas import schedules as server_schedules  # slow to import, and seldom needed

    schedule = None
    if cron is not None:
        try:
            schedule = CronSchedule(cron=cron, timezone=timezone)
        except ValueError:
            raise InputError(f"--schedule {cron!r} is no cron line such as '0 2 * * *' (in {timezone})") from None

    async def set_it() -> datetime | None:
        async with get_client() as client:
            deployment = await client.read_deployment_by_name(BATCH_DEPLOYMENT)
            for old in deployment.schedules:
                if old.slug == name:
                    await client.delete_deployment_schedule(deployment.id, old.id)
            if schedule is None:
                return None
            timed = DeploymentScheduleCreate(schedule=schedule, parameters={**parameters, "name": name}, slug=name)
            await client.create_deployment_schedules(deployment.id, [timed])
        return (await server_schedules.CronSchedule(cron=schedule.cron, timezone=timezone).get_dates(1))[0]

    return asyncio.run(set_it())


def cancel(ledger: BatchLedger, rows: Sequence[VideoRow]) -> None:
    """Tell Prefect that these flow runs are over."""
    set_states([row.flow_run for row in rows if row.flow_run], Cancelled(message="humanmm batch cancel"))


def set_states(flow_runs: Sequence[str], state: State[Any]) -> None:
    """Set the state of flow runs; those that Prefect does not know are left out."""

    async def set_all() -> None:
        async with get_client() as client:
            await _some_at_a_time([_set_state(client, UUID(run), state) for run in flow_runs])

    asyncio.run(set_all())


async def _set_state(client: PrefectClient, run: UUID, state: State[Any]) -> None:
    try:
        await client.set_flow_run_state(run, state, force=True)
    except ObjectNotFound:
        log.info("Prefect does not know the flow run %s", run)


def _pause_s(row: VideoRow) -> float:
    return 10.0 * 4 ** (row.losses - 1) if row.losses else 0.0


def queue_of(priority: str) -> str:
    """Name of the work queue for a priority; `default` is the one that every work pool has."""
    return "default" if priority == "normal" else priority


def _parameters(row: VideoRow, ledger: BatchLedger) -> dict[str, Any]:
    return {
        "video": row.video,
        "out": row.run_dir,
        "config": json.loads(row.config),
        "store": ledger.store.place,
        "batch": row.batch,
        "attempt": row.attempt,
    }


async def _some_at_a_time(requests: Sequence[Coroutine[Any, Any, T]]) -> None:
    gate = asyncio.Semaphore(AT_A_TIME)

    async def gated(request: Coroutine[Any, Any, T]) -> None:
        async with gate:
            await request

    await asyncio.gather(*(gated(request) for request in requests))
