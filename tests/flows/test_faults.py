"""Processes that are killed: what Prefect shows afterwards, and what they held."""

import itertools
import json
import os
import signal
import subprocess
import time
import urllib.request
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import httpx
import pytest
from prefect.exceptions import PrefectHTTPStatusError

from humanmm.flows.server import flow_runs, local_server
from humanmm.flows.server.known_stores import known_stores, note_store
from humanmm.flows.server.liveness import Alive, lost
from humanmm.flows.server.local_server import ServerFiles
from humanmm.flows.service import lost_runs
from humanmm.flows.service.lost_runs import note_end_before_begin
from humanmm.storage.batches.batch_ledger import VideoRow
from humanmm.storage.store.open import open_ledger

server = pytest.mark.server


def _start(toy: Any, *arguments: str, **environment: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        toy.command_line("recover", *arguments), cwd=toy.folder, env=toy.environment(**environment),
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip


def _film(toy: Any, number: int) -> str:
    (toy.folder / f"{number}.mp4").write_text(json.dumps({"num_frames": 60 + number, "cuts": [20, 40]}))
    return f"{number}.mp4"


def _wait_for(toy: Any, place: Any, executed: str) -> None:
    place.until(lambda: toy.log.exists() and executed in toy.log.read_text().split(), 120)


def test_only_a_run_whose_process_is_gone_is_lost(tmp_path: Path) -> None:
    living = Alive(tmp_path, "living")
    ended = Alive(tmp_path, "ended")
    ended.end()
    child = os.fork()
    if child == 0:
        Alive(tmp_path, "killed")
        os.kill(os.getpid(), signal.SIGKILL)
    os.waitpid(child, 0)
    assert list(lost(tmp_path)) == ["killed"]
    assert list(lost(tmp_path)) == [], "it is dealt with once"
    living.end()


def test_stores_are_noted_once_and_forgotten_when_they_are_gone(tmp_path: Path) -> None:
    files = ServerFiles(tmp_path)
    for name in ("a", "b", "a"):
        (tmp_path / name).mkdir(exist_ok=True)
        note_store(files, str(tmp_path / name))
    note_store(files, "s3://far/away")
    (tmp_path / "b").rmdir()
    assert known_stores(files) == [str(tmp_path / "a"), "s3://far/away"]
    assert files.stores.read_text().count("\n") == 3


@dataclass(frozen=True)
class _State:
    type: str
    message: str = ""


class _Run:
    """A flow run as Prefect tells of it."""

    def __init__(self, row: VideoRow, store: Path, state: _State) -> None:
        self.id, self.state = row.flow_run, state
        self.parameters = {"batch": row.batch, "video": row.video, "store": str(store), "attempt": row.attempt}


def test_a_video_whose_flow_run_ended_before_its_process_began_does_not_wait_for_ever(any_toy: Any) -> None:
    ledger = open_ledger(any_toy.store)
    row = VideoRow("b", "v.mp4", 0, "/runs/v", "{}", "normal", "[]", "", "", flow_run="one")
    ledger.put("b", "/films", [row])
    note_end_before_begin(cast(Any, _Run(replace(row, flow_run="another"), any_toy.store, _State("CRASHED", "no"))))
    assert ledger.rows("b")[0].attempt == 1, "an older flow run has nothing to say"
    note_end_before_begin(cast(Any, _Run(row, any_toy.store, _State("CRASHED", "exit status 1"))))
    (again,) = ledger.unscheduled()
    assert (again.attempt, again.losses) == (2, 1) and "did not begin: exit status 1" in again.reason
    ledger.change(again, flow_run="two")
    note_end_before_begin(cast(Any, _Run(replace(again, flow_run="two"), any_toy.store, _State("CANCELLED"))))
    assert ledger.rows("b")[0].state == "cancelled"


def test_a_video_whose_flow_run_failed_before_it_could_say_so_is_tried_again(
    toy: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    ledger = open_ledger(toy.store)
    row = VideoRow("b", "v.mp4", 0, "/runs/v", "{}", "normal", "[]", "", "", flow_run="one")
    ledger.put("b", "/films", [row])
    failed = _Run(row, toy.store, _State("FAILED", "database or disk is full"))

    def some_runs(client: object, states: list[str], **asked: object) -> list[_Run]:
        return [failed] if "FAILED" in states else []

    monkeypatch.setattr(lost_runs, "_some_runs", some_runs)
    assert not lost_runs.crash_lost_runs(cast(Any, None), 30.0)
    (again,) = ledger.unscheduled()
    assert again.attempt == 2 and "disk is full" in again.reason


class _BusyServer:
    """A client of a server that takes only some videos."""

    def __init__(self, taken: set[str]) -> None:
        self._taken = taken
        self.asked: list[str] = []

    def __enter__(self) -> "_BusyServer":
        return self

    def __exit__(self, *error: object) -> None:
        pass

    def read_deployment_by_name(self, name: str) -> Any:
        return SimpleNamespace(id=name)

    def create_flow_run_from_deployment(self, deployment: str, *, name: str, **asked: Any) -> Any:
        self.asked.append(name)
        if name in self._taken:
            return SimpleNamespace(id=f"run of {name}")
        request = httpx.Request("POST", "http://127.0.0.1/api")
        raise PrefectHTTPStatusError("503", request=request, response=httpx.Response(503, request=request))


def test_videos_that_a_busy_server_does_not_take_wait_in_the_ledger(
    toy: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HUMANMM_CACHE", str(tmp_path / "cache"))
    ledger = open_ledger(toy.store)
    rows = [VideoRow("b", f"{name}.mp4", 0, f"/runs/{name}", "{}", "normal", "[]", "", "") for name in "ab"]
    ledger.put("b", "/films", rows)
    server = _BusyServer({"a.mp4"})
    monkeypatch.setattr(flow_runs, "get_client", lambda **kind: server)
    flow_runs.schedule(ledger, rows)
    assert [row.video for row in ledger.unscheduled()] == ["b.mp4"], "`humanmm serve` schedules it at its next look"
    server = _BusyServer({"a.mp4", "b.mp4"})
    monkeypatch.setattr(flow_runs, "get_client", lambda **kind: server)
    flow_runs.schedule(ledger, rows)
    assert server.asked == ["b.mp4"], "nobody asks for what somebody has asked for meanwhile"


def test_a_server_that_dies_while_it_starts_is_started_again_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[int] = []

    def start(files: local_server.ServerFiles) -> int:
        with subprocess.Popen(["true"]) as process:
            started.append(process.pid)
        return process.pid

    monkeypatch.setattr(local_server, "START_PAUSE_S", 0.0)
    monkeypatch.setattr(local_server, "_start_process", start)
    monkeypatch.setattr(local_server, "running_server", lambda files: "here" if len(started) == 2 else None)
    assert local_server._start(local_server.ServerFiles(tmp_path)) == "here"


def test_a_server_that_is_slow_to_answer_is_waited_for_and_ended_if_it_never_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = local_server.ServerFiles(tmp_path)
    asked: list[str] = []
    monkeypatch.setattr(local_server, "_start_process", lambda files: pytest.fail("a second server beside the first"))
    monkeypatch.setattr(local_server, "running_server", lambda files: asked.append("?") or (asked[3:] and "here"))
    with subprocess.Popen(["sh", "-c", "sleep 60; true", str(tmp_path)]) as slow:
        while not Path(f"/proc/{slow.pid}/cmdline").read_bytes():  # for an instant after it was begun
            time.sleep(0.001)
        files.state.write_text(json.dumps({"pid": slow.pid}))
        assert local_server._start(files) == "here"
        assert slow.poll() is None
        asked.clear()
        monkeypatch.setattr(local_server, "SLOW_LIMIT_S", 0.0)
        monkeypatch.setattr(local_server, "running_server", lambda files: None)
        assert local_server._slow_server(files) is None
        assert slow.wait(10) == -signal.SIGKILL


@server
@pytest.mark.timeout(2400)
def test_the_flow_run_of_a_killed_recover_does_not_stay_running(toy: Any, place: Any) -> None:
    process = _start(toy, "film.mp4", TOY_SLEEP="align=100")
    _wait_for(toy, place, "align")
    page = urllib.request.urlopen(place.url.removesuffix("/api"), timeout=30).read().decode()
    assert "<title>Prefect" in page, "the dashboard is there, with nothing but loopback"
    place.until(lambda: ("align", "RUNNING") in place.ask("select name, state_type from task_run"), 60)
    process.kill()
    process.wait()
    began = time.monotonic()
    place.until(lambda: place.flow_runs() == [("film.mp4", "CRASHED")], 120)
    place.until(lambda: ("align", "CRASHED") in place.ask("select name, state_type from task_run"), 30)
    assert time.monotonic() - began < 120, "lost workers are noticed within two minutes"
    (message,) = place.ask("select message from flow_run_state where type = 'CRASHED'")
    assert "its process was lost" in message[0]


NEVER_TOLD = """
import datetime
from prefect import flow, task
from prefect.states import Completed, Running
run = await client.create_flow_run(flow(lambda: None, name="over"), state=Running())
await client.create_task_run(
    task(lambda: None), flow_run_id=run.id, dynamic_key="0", name="lost", state=Running()
)
await client.set_flow_run_state(run.id, Completed(), force=True)
"""


@server
@pytest.mark.timeout(2400)
def test_a_task_whose_end_was_never_told_does_not_stay_running(toy: Any, place: Any) -> None:
    assert _start(toy, "film.mp4", HUMANMM_SERVER_IDLE_S="300").wait(timeout=300) == 0
    place.client(NEVER_TOLD)
    lost = "select state_type from task_run where name = 'lost'"
    assert place.ask(lost) == [("RUNNING",)]
    place.until(lambda: place.ask(lost) == [("COMPLETED",)], 120)


@server
@pytest.mark.timeout(2400)
def test_the_gpu_limit_is_never_exceeded_and_a_killed_holder_frees_its_slot(toy: Any, place: Any) -> None:
    gpu = ("--run.stages", "{align = {gpu = true}}")
    holder = _start(toy, _film(toy, 0), "--run.stages", "{decode = {gpu = true}}")
    assert holder.wait(timeout=600) == 0, "without the limit nothing waits"
    place.client("from humanmm.flows.gpu import declare_gpus\nawait declare_gpus(client)")
    three = [_start(toy, _film(toy, number), *gpu, TOY_SLEEP="align=4") for number in (1, 2, 3)]
    assert [process.wait(timeout=600) for process in three] == [0, 0, 0]
    spans = []
    for number in (1, 2, 3):
        stages = json.loads((toy.folder / f"runs/{number}/run.json").read_text())["stages"]
        (align,) = [stage for stage in stages if stage["stage"] == "align"]
        # not `seconds`: to give the slot back takes its time, and the next one has it meanwhile
        spans.append((align["began"], align["began"] + align["computed_seconds"]))
    spans.sort()
    assert all(before[1] <= after[0] for before, after in itertools.pairwise(spans)), spans

    toy.executed()
    holder = _start(toy, _film(toy, 4), *gpu, TOY_SLEEP="align=300")
    _wait_for(toy, place, "align")
    holder.kill()
    holder.wait()
    began = time.monotonic()
    waiting = _start(toy, _film(toy, 5), *gpu)
    assert waiting.wait(timeout=600) == 0
    assert 20 < time.monotonic() - began < 120, "it waited for the lease, and no longer"
