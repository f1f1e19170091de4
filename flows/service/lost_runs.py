"""Videos that nobody computes any more: found, and scheduled again. The batch table is the truth; Prefect follows."""

import logging
from typing import TYPE_CHECKING

from humanmm.errors import HumanMMError
from humanmm.flows.server.known_stores import known_stores
from humanmm.flows.server.local_server import ServerFiles, is_ours, server_files

if TYPE_CHECKING:
    from uuid import UUID

    from prefect.client.orchestration import SyncPrefectClient
    from prefect.client.schemas.objects import FlowRun

log = logging.getLogger(__name__)


def crash_lost_runs(
    client: "SyncPrefectClient", settled: "set[UUID] | None" = None, *, is_starting: bool = True
) -> bool:
    """End flow runs of our deployments whose process is gone; returns whether any waits or runs.

    `settled` keeps, from one look to the next, the flow runs that ended and leave nothing to be done. Without a worker
    no process `is_starting`, and none is waited for.
    """
    from prefect.client.schemas.objects import StateType

    from humanmm.flows.server.flow_runs import POOL
    from humanmm.flows.server.liveness import LOST_AFTER_S, PAGE, end_lost_flow_runs, flow_runs_in

    settled = set() if settled is None else settled
    pool = None if is_ours(str(client.api_url), server_files()) else POOL
    at_work = end_lost_flow_runs(client, pool=pool, after_s=LOST_AFTER_S if is_starting else 0.0)
    ended = [StateType.CRASHED, StateType.CANCELLED, StateType.FAILED]
    for run in flow_runs_in(client, ended, pool=POOL, newest=PAGE):
        try:
            if run.id not in settled and fail_unstarted(run):
                settled.add(run.id)
        except HumanMMError as error:  # the next look will do; other flow runs do not wait for it
            log.info("the batches of the flow run %s could not be read: %s", run.name, error)
    return at_work or bool(flow_runs_in(client, [StateType.SCHEDULED], pool=POOL, newest=1))


def fail_unstarted(run: "FlowRun") -> bool:
    """Mark a video as lost if its flow run ended before its process started, as on a full disk.

    Returns whether the row is no longer that of this flow run, and never will be.
    """
    from humanmm.flows.server.liveness import row_of

    table, row = row_of(run)
    if table is None or row is None or row.attempt != run.parameters.get("attempt", 1) or row.state != "scheduled":
        return True
    if row.flow_run != str(run.id):
        return False
    if run.state is not None and run.state.type == "CANCELLED":
        table.change(row, only_from=("scheduled",), state="cancelled", reason="cancelled from the dashboard")
    else:
        reason = f"its process did not start: {run.state.message if run.state else 'crashed'}"
        table.lose(row, reason, only_from="scheduled")
    return True


def resume_lost_videos(files: ServerFiles) -> int:
    """Schedule videos that wait without a flow run: their process was lost or stopped; returns how many."""
    from humanmm.flows.server.flow_runs import schedule
    from humanmm.storage.batches.batch_table import open_batches

    count = 0
    for place in known_stores(files):
        try:
            table = open_batches(place)
            for batch in table.running_batches():
                table.find_lost(batch)
            rows = table.unscheduled()
            if rows:
                schedule(table, rows)
            count += len(rows)
        except HumanMMError as error:  # the next look will do; other stores do not wait for it
            log.info("the batches of a store could not be read: %s", error)
    return count
