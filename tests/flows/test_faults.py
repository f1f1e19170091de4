"""Processes that are killed: what Prefect shows afterwards, and what they held."""

import itertools
import json
import signal
import subprocess
import time
import urllib.request
from pathlib import Path
from typing import Any

import pytest

from humanmm.flows.server import local_server

server = pytest.mark.server
STOPPING = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGUSR1]


def _start(toy: Any, *arguments: str, output: int = subprocess.DEVNULL, **environment: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        toy.command_line("recover", *arguments), cwd=toy.folder, env=toy.environment(**environment),
        stdout=output, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip


def _film(toy: Any, number: int) -> str:
    (toy.folder / f"{number}.mp4").write_text(json.dumps({"num_frames": 60 + number, "cuts": [20, 40]}))
    return f"{number}.mp4"


def _wait_for(toy: Any, place: Any, executed: str) -> None:
    place.until(lambda: toy.log.exists() and executed in toy.log.read_text().split(), 120)


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
    with urllib.request.urlopen(place.url.removesuffix("/api"), timeout=30) as answer:
        page = answer.read().decode()
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


@server
@pytest.mark.timeout(2400)
@pytest.mark.parametrize("number", STOPPING, ids=lambda number: number.name)
def test_a_recover_that_is_reported_to_stop_ends_its_flow_run_as_cancelled_and_says_so(
    toy: Any, place: Any, number: signal.Signals
) -> None:
    process = _start(toy, "film.mp4", output=subprocess.PIPE, TOY_SLEEP="align=3000")
    _wait_for(toy, place, "align")
    process.send_signal(number)
    output, _ = process.communicate(timeout=300)
    assert f"stopped by {number.name}" in output
    assert "stays in the store" in output
    assert process.returncode == 130
    assert place.flow_runs() == [("film.mp4", "CANCELLED")]


@pytest.mark.parametrize("number", STOPPING[1:], ids=lambda number: number.name)
def test_a_command_that_is_reported_to_stop_before_its_flow_begins_says_so(toy: Any, number: signal.Signals) -> None:
    (toy.folder / "sitecustomize.py").write_text(
        "import os, signal\n"
        "from humanmm.flows.server import local_server\n"
        f"local_server.server_files = lambda: os.kill(os.getpid(), {number:d})\n"
    )
    done = toy.command("recover", "film.mp4")
    assert (done.returncode, done.stdout) == (130, "")
    reported = "resumable with the same command, what was computed stays in the store"
    assert done.stderr == f"humanmm: stopped by {number.name}; {reported}\n"


@server
@pytest.mark.timeout(2400)
def test_a_recover_that_nobody_listens_to_any_more_goes_on_to_its_end(toy: Any, place: Any) -> None:
    """As in `humanmm recover film.mp4 | head -0`, when a terminal is closed, and with `>&-`."""
    process = _start(toy, "film.mp4", output=subprocess.PIPE, TOY_SLEEP="align=5", TOY_FAIL="camera:20=stage")
    assert process.stdout is not None
    process.stdout.close()
    assert process.wait(timeout=300) == 3, "partial, as if its messages had been read"
    whole = [*toy.command_line("recover", "film.mp4", "--hmr.smoothness", "2")]
    closed = subprocess.run(
        ["/bin/sh", "-c", 'exec "$@" <&- >&- 2>&-', "sh", *whole], cwd=toy.folder, env=toy.environment(), check=False
    )
    assert closed.returncode == 0
    assert [state for _, state in place.flow_runs()] == ["COMPLETED", "FAILED"]
    record = json.loads((toy.folder / "runs/film/run.json").read_text())
    assert record["state"] == "done"
    assert toy.command("verify", "--deep").returncode == 0, "nothing was written into a file in place of a stream"


@server
@pytest.mark.timeout(2400)
def test_a_recover_that_was_suspended_goes_on(toy: Any, place: Any) -> None:
    process = _start(toy, "film.mp4", TOY_SLEEP="align=3")
    _wait_for(toy, place, "align")
    process.send_signal(signal.SIGSTOP)
    time.sleep(40)  # longer than any lease, and several looks of the server after lost processes
    assert place.flow_runs() == [("film.mp4", "RUNNING")]
    process.send_signal(signal.SIGCONT)
    assert process.wait(timeout=300) == 0
    assert place.flow_runs() == [("film.mp4", "COMPLETED")]


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
