"""Many videos: one Prefect flow run per video, each in a process of its own, so that a crash or a leak ends with it.

`recover_video` is `recover` with an account in the ledger of the store: what became of a video stands there, whatever
happens to Prefect's database. `recover_batch` writes a batch down and schedules its videos; the command line, the
dashboard and a schedule all come through here.
"""

import asyncio
import io
import json
import logging
from collections.abc import Coroutine, Sequence
from pathlib import Path
from typing import Any, TypeVar
from uuid import UUID

from prefect import flow, get_client
from prefect.client.orchestration import PrefectClient
from prefect.client.schemas.objects import State
from prefect.exceptions import ObjectNotFound
from prefect.runtime import flow_run
from prefect.states import Cancelled, Completed, Failed
from prefect.task_runners import ThreadPoolTaskRunner

from humanmm.config import Config
from humanmm.errors import HumanMMError
from humanmm.flows.recover import DEFAULTS, EVERYTHING, MAX_WAITING, opened, recover
from humanmm.storage.batch_ledger import BatchLedger, VideoRow
from humanmm.storage.batch_manifest import read_batch
from humanmm.storage.store import Store, default_store
from humanmm.tasks import batch as batches
from humanmm.tasks.engine import VideoRun
from humanmm.tasks.faults import in_words
from humanmm.tasks.selection import Selection

log = logging.getLogger(__name__)
T = TypeVar("T")

POOL = "humanmm"
DEPLOYMENT = "recover-video/recover-video"
AT_A_TIME = 16
"""Requests to Prefect's server that are under way at the same time."""


def _video_name() -> str:
    return Path(flow_run.parameters.get("video", "video")).name[:100]


@flow(
    name="recover-video",
    flow_run_name=_video_name,
    task_runner=ThreadPoolTaskRunner(max_workers=MAX_WAITING),  # type: ignore[arg-type]
    persist_result=False,
)
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
    ledger = BatchLedger(Store(store or default_store()))
    row = ledger.row(batch, str(video))
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
    text = io.StringIO()
    keep = logging.StreamHandler(text)
    keep.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(name)s: %(message)s"))
    logging.getLogger("humanmm").addHandler(keep)
    logging.getLogger("humanmm").setLevel(logging.INFO)

    def watch(run: VideoRun) -> None:
        account.run = run
        run.watch(lambda work, done, total: None, log_text=text.getvalue)

    token = opened.set(watch)
    try:
        state: State[Any] = recover.fn(video, out, config, store, selection)
    except Exception as error:  # noted, then raised: this is the edge of the flow
        account.end("failed", in_words(error))
        if isinstance(error, HumanMMError):
            return Failed(message=in_words(error))
        raise
    except BaseException:
        account.end("failed", "it was stopped: SIGTERM or an interrupt")
        raise
    finally:
        opened.reset(token)
    partial = state.name == "Partial"
    account.end("partial" if partial else "done", (state.message or "") if partial else "")
    return state


@flow(name="recover-batch", flow_run_name="{source}", persist_result=False)
def recover_batch(
    source: Path,
    out: Path = Path("runs"),
    config: Config = DEFAULTS,
    store: Path | None = None,
    name: str | None = None,
    pattern: str | None = None,
) -> Any:
    """Schedule every video of a folder or manifest that is not finished; asked twice, nothing is scheduled twice."""
    ledger = BatchLedger(Store(store or default_store()))
    entries = read_batch(source, pattern=pattern)
    submission = batches.submit(ledger, name or batches.batch_name(source), source, entries, config, out)
    schedule(ledger, submission.to_schedule)
    told = f"{submission.name}: {len(submission.to_schedule)} scheduled, {submission.finished} finished"
    return Completed(message=told + (f", {submission.failed} failed before" if submission.failed else ""))


# ---- between the ledger and Prefect


def schedule(ledger: BatchLedger, rows: Sequence[VideoRow]) -> None:
    """A flow run per video. A run that Prefect knows already, by batch, video and attempt, is not made again."""

    async def schedule_all() -> None:
        async with get_client() as client:
            deployment = await client.read_deployment_by_name(DEPLOYMENT)

            async def one(row: VideoRow) -> None:
                made = await client.create_flow_run_from_deployment(
                    deployment.id,
                    parameters=_parameters(row, ledger),
                    name=Path(row.video).name[:100],
                    tags=[f"batch:{row.batch}", *json.loads(row.tags)],
                    idempotency_key=f"{ledger.store.root}:{row.lock_key}:{row.attempt}",
                    work_queue_name=queue_of(row.priority),
                )
                ledger.change(row, only_from=("scheduled",), flow_run=str(made.id))

            await _some_at_a_time([one(row) for row in rows])

    asyncio.run(schedule_all())


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


def queue_of(priority: str) -> str:
    """Name of the work queue for a priority; `default` is the one that every work pool has."""
    return "default" if priority == "normal" else priority


def _parameters(row: VideoRow, ledger: BatchLedger) -> dict[str, Any]:
    return {
        "video": row.video,
        "out": row.run_dir,
        "config": json.loads(row.config),
        "store": str(ledger.store.root),
        "batch": row.batch,
        "attempt": row.attempt,
    }


async def _some_at_a_time(requests: Sequence[Coroutine[Any, Any, T]]) -> None:
    gate = asyncio.Semaphore(AT_A_TIME)

    async def gated(request: Coroutine[Any, Any, T]) -> None:
        async with gate:
            await request

    await asyncio.gather(*(gated(request) for request in requests))
