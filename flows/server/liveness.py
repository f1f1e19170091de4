"""Flow runs whose process is gone: Prefect is not informed of a kill -9, and would call them `Running` for ever.

A video of a batch lives as long as its row in the batch table has a living owner. Any other flow run on our own server,
where everything runs on this machine, lives as long as the process whose id it names: Prefect's worker writes it there,
and `recover` its own. (Prefect's heartbeats do not serve: they pass through its server, and while that is being
restarted every living flow run looks lost.)
"""

import contextlib
import datetime
import logging
import os
from collections.abc import Sequence
from typing import Any

import httpx
from prefect.client.orchestration import SyncPrefectClient
from prefect.client.schemas.filters import (
    FlowRunFilter,
    FlowRunFilterEndTime,
    FlowRunFilterId,
    FlowRunFilterState,
    FlowRunFilterStateType,
    TaskRunFilter,
    TaskRunFilterState,
    TaskRunFilterStateType,
    WorkPoolFilter,
    WorkPoolFilterName,
)
from prefect.client.schemas.objects import FlowRun, State, StateType
from prefect.client.schemas.sorting import FlowRunSort
from prefect.context import FlowRunContext
from prefect.exceptions import PrefectException
from prefect.states import Completed, Crashed, Failed

from humanmm import machine
from humanmm.errors import HumanMMError
from humanmm.storage.batches.batch_table import BatchTable, open_batches
from humanmm.storage.batches.video_row import VideoRow

log = logging.getLogger(__name__)

LOST_AFTER_S = 30.0
"""Seconds in a state without a process after which a flow run is lost: a process that starts is not known at once."""
START_FACTOR = 3
"""So much longer where only the batch table shows a process, which has to load everything before it owns a row."""
YOUNGER_S = 120.0
"""A process started so long after its flow run took its state is another one, which got the same id."""
TASKS_AFTER_S = 45.0
"""A task of a flow run that ended so long ago has reported all that it will ever report."""
PAGE = 200
"""Flow runs a request: what Prefect's server returns at most."""
AT_WORK = (StateType.PENDING, StateType.RUNNING, StateType.CANCELLING)
LOST = "its process was lost: it was killed, ran out of memory, or the machine went down"


def write_process_id() -> None:
    """Name this process in the flow run that it computes, unless a worker has started it and does so."""
    context = FlowRunContext.get()
    if context is not None and context.flow_run is not None and context.flow_run.deployment_id is None:
        with contextlib.suppress(PrefectException, httpx.HTTPError):
            client: Any = context.client
            client.update_flow_run(context.flow_run.id, infrastructure_pid=str(os.getpid()))


def end_lost_flow_runs(client: SyncPrefectClient, *, pool: str | None, after_s: float = LOST_AFTER_S) -> bool:
    """End the flow runs whose process is gone, and their tasks; returns whether others are at work.

    Of `pool` alone; None for all of our own server, whose flow runs are processes of this machine.
    """
    found = flow_runs_in(client, AT_WORK, pool=pool)
    lost = 0
    for run in found:
        state = _final_state(run, after_s, is_our_server=pool is None)
        if state is not None:
            lost += 1
            log.warning("the process of the flow run %s (%s) is gone", run.name, run.id)
            client.set_flow_run_state(run.id, state, force=True)
            _end_tasks(client, FlowRunFilter(id=FlowRunFilterId(any_=[run.id])), Crashed(message=LOST))
    return len(found) > lost


def end_lost_tasks(client: SyncPrefectClient) -> None:
    """End the tasks of flow runs that have ended.

    A task sends its states without waiting for a response: what was under way when its process or the server was killed
    never arrived, and it would stay `Running`.
    """
    before: Any = datetime.datetime.now(datetime.UTC) - datetime.timedelta(seconds=TASKS_AFTER_S)
    ends: list[tuple[list[StateType], State[Any]]] = [
        ([StateType.COMPLETED], Completed(message="its end did not arrive; its flow run is completed")),
        (
            [StateType.FAILED, StateType.CRASHED, StateType.CANCELLED],
            Crashed(message="its end did not arrive; its flow run has ended"),
        ),
    ]
    for states, end in ends:
        in_states = FlowRunFilterState(type=FlowRunFilterStateType(any_=states))
        _end_tasks(client, FlowRunFilter(state=in_states, end_time=FlowRunFilterEndTime(before_=before)), end)


def flow_runs_in(
    client: SyncPrefectClient, states: Sequence[StateType], *, pool: str | None, newest: int | None = None
) -> list[FlowRun]:
    """Flow runs in some states, all read before any is changed; with `newest` only so many that ended last."""
    in_states = FlowRunFilter(state=FlowRunFilterState(type=FlowRunFilterStateType(any_=list(states))))
    of_pool = WorkPoolFilter(name=WorkPoolFilterName(any_=[pool])) if pool else None
    order = FlowRunSort.ID_DESC if newest is None else FlowRunSort.END_TIME_DESC
    limit = PAGE if newest is None else newest
    runs: list[FlowRun] = []
    while True:
        page = client.read_flow_runs(
            flow_run_filter=in_states, work_pool_filter=of_pool, sort=order, limit=limit, offset=len(runs)
        )
        runs += page
        if newest is not None or len(page) < PAGE:
            return runs


def row_of(run: FlowRun) -> tuple[BatchTable | None, VideoRow | None]:
    """The batch table that a flow run belongs to, if it can be reached from here, and its video's row."""
    given = run.parameters
    if not given.get("batch") or not given.get("store"):
        return None, None
    table = open_batches(given["store"])
    if not table.exists:
        return None, None
    return table, table.row(given["batch"], given["video"])


def _final_state(run: FlowRun, after_s: float, *, is_our_server: bool) -> State[Any] | None:
    """The state of a flow run whose process is gone; None if it lives, or if that cannot be known here."""
    if run.state is None:
        return None
    age_s = (datetime.datetime.now(datetime.UTC) - run.state.timestamp).total_seconds()
    is_alive = _has_living_process(run, age_s) if is_our_server else None
    if run.work_pool_name is None:  # a plain `recover`
        return Crashed(message=LOST) if is_alive is False else None
    if run.state.is_pending() and not is_our_server:
        after_s *= START_FACTOR
    if is_alive or age_s < after_s:
        return None
    table = None
    try:
        table, row = row_of(run)
        if table is not None and row is not None:
            return None if row.is_owned else _state_by_row(run, table)
    except HumanMMError as error:  # its row does not count: other flow runs do not wait for it
        log.info("the batches of the flow run %s could not be read: %s", run.name, error)
    is_lost = (is_alive is False or run.state.is_pending()) if is_our_server else table is not None
    return Crashed(message=LOST) if is_lost else None


def _has_living_process(run: FlowRun, age_s: float) -> bool | None:
    """Whether the process lives that a flow run names; None if it names none. `age_s` is the age of its state."""
    if not (run.infrastructure_pid or "").isdecimal():
        return None
    process_s = machine.age_s(int(run.infrastructure_pid or 0))
    return process_s is not None and process_s > age_s - YOUNGER_S


def _state_by_row(run: FlowRun, table: BatchTable) -> State[Any]:
    batch, video = run.parameters["batch"], run.parameters["video"]
    table.find_lost(batch)
    row = table.row(batch, video)
    is_its_own = row is not None and row.attempt == run.parameters.get("attempt", 1)
    if row is None or (is_its_own and row.state == "scheduled"):  # what the row says is of an earlier attempt
        return Crashed(message=LOST)
    if is_its_own and row.state == "done":
        return Completed(message=row.run_dir)
    if is_its_own and row.state == "partial":
        return Failed(name="Partial", message=row.reason)
    return Crashed(message=row.reason)


def _end_tasks(client: SyncPrefectClient, flow_runs: FlowRunFilter, end: State[Any]) -> None:
    unfinished = TaskRunFilterStateType(any_=[StateType.SCHEDULED, StateType.PENDING, StateType.RUNNING])
    tasks = TaskRunFilter(state=TaskRunFilterState(type=unfinished))
    for task in client.read_task_runs(flow_run_filter=flow_runs, task_run_filter=tasks, limit=PAGE):
        client.set_task_run_state(task.id, end, force=True)
