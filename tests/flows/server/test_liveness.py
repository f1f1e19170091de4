"""Which flow runs are ended because their process is gone, and as what."""

import datetime
import os
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast
from uuid import UUID, uuid4

import pytest
from prefect.client.schemas.objects import FlowRun, State, StateType
from prefect.states import Pending, Running

from humanmm.flows.server.liveness import LOST_AFTER_S, START_FACTOR, YOUNGER_S, end_lost_flow_runs
from humanmm.storage.batches.batch_table import BatchTable, open_batches
from humanmm.storage.batches.video_row import VideoRow


class _Server:
    """A client of a server with some flow runs; keeps the states that are set."""

    def __init__(self, *runs: FlowRun) -> None:
        self.runs = runs
        self.set: dict[UUID, State[Any]] = {}

    def read_flow_runs(self, **filters: Any) -> Sequence[FlowRun]:
        return self.runs

    def read_task_runs(self, **filters: Any) -> Sequence[Any]:
        return []

    def set_flow_run_state(self, run: UUID, state: State[Any], *, force: bool) -> None:
        self.set[run] = state


def _run(
    state: State[Any], age_s: float, *, pid: int | None = None, pool: str | None = "humanmm", **given: Any
) -> FlowRun:
    state = state.model_copy(
        update={"timestamp": datetime.datetime.now(datetime.UTC) - datetime.timedelta(seconds=age_s)}
    )
    named = None if pid is None else str(pid)
    return FlowRun(
        id=uuid4(), flow_id=uuid4(), state=state, infrastructure_pid=named, work_pool_name=pool, parameters=given
    )


def _ended(run: FlowRun, pool: str | None = None) -> State[Any] | None:
    server = _Server(run)
    at_work = end_lost_flow_runs(cast(Any, server), pool=pool)
    assert at_work == (run.id not in server.set)
    return server.set.get(run.id)


@pytest.fixture
def dead() -> int:
    child = subprocess.Popen(["true"])
    child.wait()
    return child.pid


def test_a_plain_recover_is_crashed_as_soon_as_its_process_is_gone_and_not_before(dead: int) -> None:
    assert _ended(_run(Running(), 60.0, pid=os.getpid(), pool=None)) is None
    assert _ended(_run(Running(), 60.0, pool=None)) is None, "it has not written its process id yet"
    crashed = _ended(_run(Running(), 1.0, pid=dead, pool=None))
    assert crashed is not None and crashed.type == StateType.CRASHED and "killed" in (crashed.message or "")


def test_what_a_worker_started_is_crashed_when_its_process_is_gone_whatever_flow_it_is(dead: int) -> None:
    assert _ended(_run(Running(), 60.0, pid=os.getpid())) is None
    assert _ended(_run(Running(), 1.0, pid=dead)) is None, "the id may be that of the run before a retry"
    crashed = _ended(_run(Running(), LOST_AFTER_S + 1, pid=dead, store="/nowhere", deep=True))
    assert crashed is not None and crashed.type == StateType.CRASHED


def test_a_flow_run_whose_worker_died_before_it_started_a_process_holds_its_slot_for_half_a_minute() -> None:
    assert _ended(_run(Pending(), LOST_AFTER_S - 10)) is None
    assert _ended(_run(Pending(name="Submitting"), LOST_AFTER_S + 1)) is not None
    assert _ended(_run(Pending(), LOST_AFTER_S + 1, pid=os.getpid())) is None, "a process that starts slowly"


def test_a_process_that_is_much_younger_than_the_flow_run_is_another_one() -> None:
    child = subprocess.Popen(["sleep", "60"])
    try:
        assert _ended(_run(Running(), YOUNGER_S - 60, pid=child.pid)) is None
        assert _ended(_run(Running(), YOUNGER_S + 60, pid=child.pid)) is not None, "the machine was started anew"
    finally:
        child.kill()
        child.wait()


def _video(tmp_path: Path, **values: Any) -> tuple[BatchTable, dict[str, Any]]:
    table = open_batches(tmp_path)
    row = VideoRow("b", "v.mp4", 0, "/runs/v", "{}", "normal", "[]", "", "", flow_run="one", **values)
    table.put([row])
    return table, {"batch": "b", "video": "v.mp4", "store": str(tmp_path), "attempt": row.attempt}


@pytest.mark.parametrize(
    ("state", "ended"),
    [("done", "Completed"), ("partial", "Partial"), ("cancelled", "Crashed"), ("running", "Crashed")],
)
def test_the_row_of_a_video_says_how_its_flow_run_ended(tmp_path: Path, dead: int, state: str, ended: str) -> None:
    table, given = _video(tmp_path, state=state)
    set_state = _ended(_run(Running(), 60.0, pid=dead, **given))
    assert set_state is not None and set_state.name == ended
    assert (table.rows("b")[0].state, table.rows("b")[0].attempt) == (
        ("scheduled", 2) if state == "running" else (state, 1)
    )


def test_on_a_server_of_the_user_the_table_alone_says_whether_a_video_is_computed(tmp_path: Path, dead: int) -> None:
    table, given = _video(tmp_path)
    (row,) = table.rows("b")
    assert table.claim(row)
    assert _ended(_run(Running(), 600.0, pid=dead, **given), pool="humanmm") is None, "its process has another id there"
    table.release(row)
    assert _ended(_run(Running(), LOST_AFTER_S - 10, **given), pool="humanmm") is None
    assert _ended(_run(Running(), LOST_AFTER_S + 1, **given), pool="humanmm") is not None
    assert _ended(_run(Pending(), START_FACTOR * LOST_AFTER_S - 10, **given), pool="humanmm") is None
    assert _ended(_run(Running(), 600.0, pid=dead, store="/nowhere"), pool="humanmm") is None, "a `maintain` elsewhere"


def test_the_process_alone_counts_where_the_batches_cannot_be_read(tmp_path: Path, dead: int) -> None:
    (tmp_path / "batches.sqlite").write_bytes(b"garbage" * 100)
    given = {"batch": "b", "video": "v.mp4", "store": str(tmp_path)}
    crashed = _ended(_run(Running(), 60.0, pid=dead, **given))
    assert crashed is not None and crashed.type == StateType.CRASHED
    assert _ended(_run(Running(), 60.0, pid=os.getpid(), **given)) is None
    assert _ended(_run(Running(), 600.0, pid=dead, **given), pool="humanmm") is None, "its process has another id there"
