"""Many videos: one Prefect flow run per video, each in a process of its own, so that a crash or a leak ends with it.

`recover_video` is `recover` with a row in the batch table: what became of a video stands there, whatever happens to
Prefect's database. `recover_batch` writes the rows of a batch and schedules its videos, for the dashboard and for
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
from humanmm.flows.recover import DEFAULTS, EVERYTHING, opened, recover, recover_stages, video_name
from humanmm.flows.server.flow_runs import cancel_late, schedule
from humanmm.logs import keeping_text, to_standard_error, wants_json
from humanmm.storage.batches.batch_table import open_batches
from humanmm.tasks.batches.request import BatchRequest
from humanmm.tasks.batches.running_video import RunningVideo, retried
from humanmm.tasks.batches.watch import is_quiet
from humanmm.tasks.engine.run import VideoRun
from humanmm.tasks.units.faults import in_words
from humanmm.tasks.units.selection import Selection

log = logging.getLogger(__name__)

QUERY_LIMIT_S = 5.0
"""Seconds to query the reason for a SIGTERM; SIGKILL follows."""


@flow(name="recover-video", flow_run_name=video_name, persist_result=False)
def recover_video(
    video: Path,
    out: Path | None = None,
    config: Config = DEFAULTS,
    store: Path | None = None,
    selection: Selection = EVERYTHING,
    batch: str | None = None,
    attempt: int = 1,
) -> Any:
    """Recover one video into a run folder. As a video of a batch, keep its row in the batch table up to date."""
    if batch is None:
        return recover.fn(video, out, config, store, selection)
    table = open_batches(store)
    row = retried(lambda: table.row(batch, str(video)))
    if row is None or row.attempt != attempt:
        return Cancelled(message=f"batch {batch} no longer wants attempt {attempt} at this video")
    running = RunningVideo(table, row)
    with running.owned(str(flow_run.id)) as is_ours:
        if not is_ours:
            return Cancelled(message="it was cancelled, or another process computes it")
        return _recover_running(running, video, out, config, store, selection)


def _recover_running(
    running: RunningVideo, video: Path, out: Path | None, config: Config, store: Path | None, selection: Selection
) -> Any:
    if wants_json():
        to_standard_error(verbose=False)

    def watch(run: VideoRun) -> None:
        running.run = run
        run.log_text = text.getvalue

    token = opened.set(watch)
    try:
        with keeping_text() as text:
            state: State[Any] = recover_stages(video, out, config, store, selection)
    except Exception as error:  # recorded, then raised: this is the edge of the flow
        running.fail(error)
        if isinstance(error, HumanMMError):
            return Failed(message=in_words(error))
        raise
    except BaseException:
        _end_stopped(running)
        raise
    finally:
        opened.reset(token)
    if state.name == "Partial":
        running.end_partial(state.message or "")
    else:
        running.end("done", "")
    return state


def _end_stopped(running: RunningVideo) -> None:
    """Record why its process received SIGTERM: cancelled from the dashboard, else to be resumed by `humanmm serve`."""
    try:
        with get_client(httpx_settings={"timeout": QUERY_LIMIT_S}, sync_client=True) as client:
            state = client.read_flow_run(UUID(running.flow_run)).state
        cancelled = state is not None and (state.is_cancelling() or state.is_cancelled())
    except Exception as error:  # the server may have been stopped first
        log.info("the Prefect server did not respond: %s", error)
        cancelled = False
    if cancelled:
        running.end("cancelled", "cancelled from the dashboard")
    else:
        running.resume_later("it was stopped, and resumes when `humanmm serve` runs")


def batch_title() -> str:
    """What the flow run is called: as its batch, or its source where that has no name of its own."""
    return str(flow_run.parameters.get("name") or flow_run.parameters.get("source", "batch"))[:100]


@flow(name="recover-batch", flow_run_name=batch_title, persist_result=False)
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
    """Schedule every video of a folder or manifest that is not finished; run twice, nothing is scheduled twice.

    Files that were written to less than `settle_s` seconds ago wait for the next time: they may still be growing.
    """
    if name is not None:
        cancel_late(name)
    table = open_batches(store)
    request = BatchRequest(
        source=source, out=out, config=config, name=name, pattern=pattern, priority=priority, tags=tags,
        settle_s=settle_s,
    )  # fmt: skip
    found = request.videos()
    quiet = [entry for entry in found if is_quiet(entry.video, settle_s)]
    submission = request.submit(table, quiet)
    schedule(table, submission.to_schedule)
    growing = len(found) - len(quiet)
    written = f"; {growing} still being written" if growing else ""
    return Completed(message=f"{submission.name}: {submission.sentence}{written}")
