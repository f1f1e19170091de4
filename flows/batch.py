"""Many videos: one Prefect flow run per video, each in a process of its own, so that a crash or a leak ends with it.

`recover_video` is `recover` with an account in the ledger of the store: what became of a video stands there, whatever
happens to Prefect's database. `recover_batch` writes a batch down and schedules its videos, for the dashboard and for
schedules.
"""

import logging
from pathlib import Path
from typing import Any
from uuid import UUID

from prefect import flow, get_client
from prefect.client.schemas.objects import State
from prefect.runtime import flow_run
from prefect.states import Cancelled, Completed, Failed

from humanmm.config import Config
from humanmm.errors import HumanMMError
from humanmm.flows.recover import DEFAULTS, EVERYTHING, opened, recover
from humanmm.flows.server.flow_runs import schedule
from humanmm.logs import kept_text, to_standard_error, wants_json
from humanmm.storage.batches.manifest import read_batch
from humanmm.storage.store.open import open_ledger
from humanmm.storage.store.store import default_store
from humanmm.tasks.batches import batch as batches
from humanmm.tasks.batches.watch import is_quiet
from humanmm.tasks.engine.run import VideoRun
from humanmm.tasks.units.faults import in_words
from humanmm.tasks.units.selection import Selection

log = logging.getLogger(__name__)

STOP_ASKS_S = 5.0
"""How long one who is told to stop asks why: it is killed soon."""


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
        run.watch(lambda unit, done, total: None, log_text=text.getvalue)

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
