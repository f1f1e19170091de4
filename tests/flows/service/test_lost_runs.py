"""Videos whose flow run ended before their process started, and slots that lost flow runs held."""

import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast
from uuid import UUID, uuid4

import pytest
from prefect.states import Cancelled, Crashed, Failed

from humanmm.flows.server import flow_runs
from humanmm.flows.server.local_server import ServerFiles
from humanmm.flows.service.lost_runs import crash_lost_runs, fail_unstarted, resume_lost_videos
from humanmm.storage.batches.batch_table import BatchTable, open_batches
from humanmm.storage.batches.video_row import VideoRow


def _waiting(table: BatchTable) -> VideoRow:
    (row,) = table.put([VideoRow("b", "v.mp4", 0, "/runs/v", "{}", "normal", "[]", "", "", flow_run=str(UUID(int=1)))])
    return row


def _run(row: VideoRow, table: BatchTable, state: Any) -> Any:
    given = {"batch": row.batch, "video": row.video, "store": table.store.location, "attempt": row.attempt}
    return SimpleNamespace(id=UUID(row.flow_run), state=state, parameters=given)


def test_a_video_whose_flow_run_ended_before_its_process_started_does_not_wait_for_ever(any_toy: Any) -> None:
    table = open_batches(any_toy.store)
    row = _waiting(table)
    older = replace(row, flow_run=str(uuid4()))
    assert not fail_unstarted(_run(older, table, Crashed(message="no")))
    assert table.rows("b")[0].attempt == 1, "an older flow run changes nothing"
    assert fail_unstarted(_run(row, table, Crashed(message="exit status 1")))
    (again,) = table.unscheduled()
    assert (again.attempt, again.losses) == (2, 1) and "did not start: exit status 1" in again.reason
    table.change(again, flow_run=str(UUID(int=2)))
    assert fail_unstarted(_run(table.rows("b")[0], table, Cancelled()))
    assert table.rows("b")[0].state == "cancelled"


def test_a_video_whose_flow_run_failed_before_it_could_write_its_row_is_tried_again(toy: Any) -> None:
    table = open_batches(toy.store)
    failed = _run(_waiting(table), table, Failed(message="database or disk is full"))

    def read_flow_runs(*, flow_run_filter: Any, **more: Any) -> list[Any]:
        return [failed] if "FAILED" in flow_run_filter.state.type.any_ else []

    client = SimpleNamespace(read_flow_runs=read_flow_runs, api_url="http://127.0.0.1:1/api")
    assert not crash_lost_runs(cast(Any, client))
    (again,) = table.unscheduled()
    assert again.attempt == 2 and "disk is full" in again.reason


def test_a_store_whose_batches_cannot_be_read_does_not_hold_up_the_others(
    toy: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    damaged, table = tmp_path / "damaged", open_batches(toy.store)
    damaged.mkdir()
    (damaged / "batches.sqlite").write_bytes(b"garbage" * 100)
    failed = _run(_waiting(table), table, Failed(message="it did not start"))
    unknown = SimpleNamespace(
        id=uuid4(), name="v", state=failed.state, parameters={**failed.parameters, "store": str(damaged)}
    )

    def read_flow_runs(*, flow_run_filter: Any, **more: Any) -> list[Any]:
        return [unknown, failed] if "FAILED" in flow_run_filter.state.type.any_ else []

    client, settled = SimpleNamespace(read_flow_runs=read_flow_runs, api_url="http://127.0.0.1:1/api"), set[UUID]()
    crash_lost_runs(cast(Any, client), settled)
    assert settled == {failed.id} and len(table.unscheduled()) == 1, "the other one is looked at again"
    sent: list[str] = []
    monkeypatch.setattr(flow_runs, "schedule", lambda table, rows: sent.append(table.store.location))
    monkeypatch.setitem(sys.modules, "obstore", None)
    monkeypatch.setitem(sys.modules, "obstore.store", None)
    files = ServerFiles(tmp_path / "home")
    files.home.mkdir()
    files.stores.write_text(f"{damaged}\ns3://nowhere/store\n{toy.store}\n")
    assert resume_lost_videos(files) == 1 and sent == [str(toy.store)]


MAINTAIN = """
deployment = await client.read_deployment_by_name("maintain/maintain")
await client.create_flow_run_from_deployment(deployment.id, name="upkeep")
"""
SUBMITTING = """
import datetime
from prefect.states import Pending, Scheduled
deployment = await client.read_deployment_by_name("recover-batch/recover-batch")
later = Scheduled(scheduled_time=datetime.datetime.now(datetime.UTC) + datetime.timedelta(days=1))
run = await client.create_flow_run_from_deployment(
    deployment.id, name="upkeep", state=later, parameters={"source": "films"}
)
await client.set_flow_run_state(run.id, Pending(name="Submitting"), force=True)
"""


@pytest.mark.server
@pytest.mark.timeout(2400)
@pytest.mark.parametrize("lost", [MAINTAIN, SUBMITTING], ids=["a maintain that runs", "a batch in Submitting"])
@pytest.mark.parametrize("any_toy", ["disk"], indirect=True)
def test_a_slot_whose_flow_run_was_lost_with_everything_is_free_soon_after_the_next_start(
    farm: Any, place: Any, states: Callable[[], dict[str, dict[str, Any]]], lost: str
) -> None:
    serving = subprocess.Popen(
        farm.command_line("serve", "--limit", "1"), env=farm.environment(), stdout=subprocess.DEVNULL
    )
    place.until(lambda: list(place.folder.glob("prefect-*/serving")), 120)
    place.client(lost)
    at_work = ("PENDING", "RUNNING")
    place.until(lambda: place.ask("select 1 from flow_run where state_type in (?, ?)", *at_work), 60)
    place.end("-m toyline serve", signal.SIGKILL)
    place.end("humanmm.flows.")
    serving.wait()
    ((name, state),) = place.flow_runs()
    assert name == "upkeep" and state in at_work, "it holds the one slot"
    assert farm.command("batch", "submit", "films", "--limit", "1").returncode == 0
    place.until(lambda: {"running", "done"} & {video["state"] for video in states().values()}, 30)
    assert ("upkeep", "CRASHED") in place.flow_runs()
