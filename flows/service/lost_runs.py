"""Videos and flow runs that nobody computes any more: found, told to Prefect, and tried again.

The truth is the ledger of the store and its locks; Prefect's own view is brought into line with it.
"""

import datetime
import logging
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from humanmm.errors import StoreError
from humanmm.flows.server.known_stores import known_stores
from humanmm.flows.server.local_server import ServerFiles
from humanmm.storage.batches.batch_ledger import BatchLedger, VideoRow
from humanmm.storage.batches.disk_ledger import FILE
from humanmm.storage.store.bucket import is_bucket
from humanmm.storage.store.open import open_ledger

if TYPE_CHECKING:
    from uuid import UUID

    from prefect.client.orchestration import SyncPrefectClient
    from prefect.client.schemas.objects import FlowRun, State, StateType

log = logging.getLogger(__name__)

START_FACTOR = 3
"""A process may take that much longer to begin than to hold its video once it has begun."""
PAGE = 200
"""Flow runs that are asked for at a time: what Prefect's server gives at most."""


def crash_lost_runs(client: "SyncPrefectClient", after_s: float, settled: "set[UUID] | None" = None) -> bool:
    """End flow runs of our deployments that nobody computes any more; returns whether any waits or runs.

    `settled` keeps, from one look to the next, the flow runs that ended and leave nothing to be done.
    """
    settled = set() if settled is None else settled
    from prefect.client.schemas.objects import StateType

    runs = _all_runs(client, StateType.PENDING, StateType.RUNNING, StateType.CANCELLING)
    for run in runs:
        ended = _how_it_ended(run, after_s)
        if ended is not None:
            client.set_flow_run_state(run.id, ended, force=True)
    over = [StateType.CRASHED, StateType.CANCELLED, StateType.FAILED]
    for run in _some_runs(client, over, limit=PAGE, order="END_TIME_DESC"):
        if run.id not in settled and note_end_before_begin(run):
            settled.add(run.id)
    return bool(runs) or bool(_some_runs(client, [StateType.SCHEDULED], limit=1))


def note_end_before_begin(run: "FlowRun") -> bool:
    """Tell the ledger of a flow run that ended before its process could, as on a full disk: its video waits in vain.

    Returns whether its video waits for it no longer, and never will.
    """
    ledger, row = _in_ledger(run)
    if ledger is None or row is None or row.attempt != run.parameters.get("attempt", 1) or row.state != "scheduled":
        return True
    if row.flow_run != str(run.id):
        return False
    if run.state is not None and run.state.type == "CANCELLED":
        ledger.change(row, only_from=("scheduled",), state="cancelled", reason="cancelled from the dashboard")
    else:
        ledger.never_began(row, f"its process did not begin: {run.state.message if run.state else 'crashed'}")
    return True


def _in_ledger(run: "FlowRun") -> tuple[BatchLedger | None, VideoRow | None]:
    """The ledger that a flow run belongs to, if that is in a bucket or on this machine, and its video."""
    given = run.parameters
    place = str(given.get("store") or "-")
    if not given.get("batch") or not (is_bucket(place) or (Path(place) / FILE).exists()):
        return None, None
    ledger = open_ledger(place)
    return ledger, ledger.row(given["batch"], given["video"])


def _how_it_ended(run: "FlowRun", after_s: float) -> "State[Any] | None":
    """The state of a flow run whose process is gone; None if it lives, or if that cannot be told from here."""
    from prefect.states import Completed, Crashed, Failed

    given, state = run.parameters, run.state
    ledger, row = _in_ledger(run)
    if state is None or ledger is None:
        return None
    since = datetime.datetime.now(datetime.UTC) - state.timestamp
    if state.is_pending():  # its process is starting
        after_s *= START_FACTOR
    if since.total_seconds() < after_s or (row is not None and ledger.is_held(row)):
        return None
    ledger.find_lost(given["batch"])
    row = ledger.row(given["batch"], given["video"])
    is_its_own = row is not None and row.attempt == given.get("attempt", 1)
    if row is None or (is_its_own and row.state == "scheduled"):  # what the row says is of an earlier attempt
        return Crashed(message="nothing was heard of it")
    if is_its_own and row.state == "done":
        return Completed(message=row.run_dir)
    if is_its_own and row.state == "partial":
        return Failed(name="Partial", message=row.reason)
    return Crashed(message=row.reason)


def _all_runs(client: "SyncPrefectClient", *states: "StateType") -> "list[FlowRun]":
    """Flow runs of our deployments in some states, read page by page before any of them is changed."""
    runs: list[FlowRun] = []
    while len(page := _some_runs(client, states, limit=PAGE, offset=len(runs))) == PAGE:
        runs += page
    return [*runs, *page]


def _some_runs(
    client: "SyncPrefectClient", states: "Sequence[StateType]", *, limit: int, offset: int = 0, order: str = "ID_DESC"
) -> "list[FlowRun]":
    from prefect.client.schemas.filters import (
        FlowRunFilter,
        FlowRunFilterState,
        FlowRunFilterStateType,
        WorkPoolFilter,
        WorkPoolFilterName,
    )
    from prefect.client.schemas.sorting import FlowRunSort

    from humanmm.flows.server.flow_runs import POOL

    return client.read_flow_runs(
        flow_run_filter=FlowRunFilter(state=FlowRunFilterState(type=FlowRunFilterStateType(any_=list(states)))),
        work_pool_filter=WorkPoolFilter(name=WorkPoolFilterName(any_=[POOL])),
        sort=FlowRunSort(order),
        limit=limit,
        offset=offset,
    )


def resume_lost_videos(files: ServerFiles) -> int:
    """Schedule what waits although Prefect was not told: videos whose process was lost or stopped; returns how many."""
    from humanmm.flows.server.flow_runs import schedule

    count = 0
    for place in known_stores(files):
        try:
            ledger = open_ledger(place)
            for batch in ledger.batches_at_work():
                ledger.find_lost(batch)
            rows = ledger.unscheduled()
        except StoreError as error:  # the next look will tell; other stores do not wait for it
            log.info("a store did not answer: %s", error)
            continue
        if rows:
            schedule(ledger, rows)
        count += len(rows)
    return count
