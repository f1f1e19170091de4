"""One running video of a batch: its process owns the row, writes how it ends, and stops when it is not wanted."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from humanmm.config import Config
from humanmm.errors import NoUsablePersonError, StageError, StoreError, VideoError
from humanmm.storage.batches import owner as owners
from humanmm.storage.batches.batch_table import BatchTable, open_batches
from humanmm.storage.batches.manifest import read_batch
from humanmm.storage.batches.video_row import VideoRow, counts, facts_of
from humanmm.tasks.batches import batch as batches
from humanmm.tasks.batches import running_video
from humanmm.tasks.batches.running_video import RunningVideo
from humanmm.tasks.batches.status import status_lines


@pytest.fixture
def table(toy: Any) -> BatchTable:
    return open_batches(toy.store)


def _submit(toy: Any, table: BatchTable, *names: str) -> Sequence[VideoRow]:
    films = Path(toy.folder / "films")
    films.mkdir()
    for name in names:
        (films / name).write_text(json.dumps({"num_frames": 60, "cuts": [20, 40]}))
    return batches.submit(table, "test", read_batch(films), Config(), toy.folder / "runs").to_schedule


def _worker(toy: Any) -> subprocess.Popen[str]:
    """A process that owns the first video of the batch."""
    script = (
        "import sys, time\n"
        "from humanmm.storage.batches.batch_table import open_batches\n"
        "from humanmm.tasks.batches import running_video\n"
        "running_video.LOOK_EVERY_S = running_video.RENEW_S = 0.2\n"
        "table = open_batches(sys.argv[1])\n"
        "with running_video.RunningVideo(table, table.rows('test')[0]).owned('run') as is_ours:\n"
        "    print(is_ours, flush=True)\n"
        "    time.sleep(60)\n"
    )
    worker = subprocess.Popen(
        [sys.executable, "-c", script, str(toy.store)], env=toy.environment(), stdout=subprocess.PIPE, text=True
    )
    assert worker.stdout is not None and worker.stdout.readline() == "True\n"
    return worker


def test_a_running_video_whose_process_was_killed_is_found_lost(toy: Any, table: BatchTable) -> None:
    (row,) = _submit(toy, table, "a.mp4")
    worker = _worker(toy)
    assert table.find_lost("test") == []
    running = table.rows("test")[0]
    assert (running.state, running.pid, running.flow_run) == ("running", worker.pid, "run")
    with RunningVideo(table, running).owned("other") as is_ours:
        assert not is_ours, "one video is never computed twice at the same time"
    os.kill(worker.pid, signal.SIGKILL)
    _close(worker)
    began = time.monotonic()
    assert [lost.video for lost in table.find_lost("test")] == [row.video]
    assert time.monotonic() - began < 1
    (again,) = table.unscheduled()
    assert (again.state, again.attempt, again.losses) == ("scheduled", 2, 1) and "its process was lost" in again.reason


def test_a_video_whose_file_was_replaced_after_it_was_submitted_says_so(toy: Any, table: BatchTable) -> None:
    kept, other = _submit(toy, table, "a.mp4", "b.mp4")
    Path(other.video).write_text(json.dumps({"num_frames": 61, "cuts": []}))
    for row in (kept, other):
        running = RunningVideo(table, row)
        with running.owned("run"):
            running.end("done", "")
    assert [row.reason for row in table.rows("test")] == ["", "the file was replaced after it was submitted"]
    assert [row.facts for row in table.rows("test")] == [facts_of(Path(row.video)) for row in (kept, other)]
    assert "  1 done: the file was replaced after it was submitted" in status_lines("test", table.rows("test"))


def test_a_process_ends_whose_video_was_cancelled_from_another_machine(
    toy: Any, table: BatchTable, monkeypatch: pytest.MonkeyPatch
) -> None:
    _submit(toy, table, "a.mp4")
    worker = _worker(toy)
    (running,) = table.rows("test")
    assert running.host == socket.gethostname() and not running.is_elsewhere
    table.change(running, host="another", flow_run=None)
    with monkeypatch.context() as elsewhere:
        elsewhere.setattr(owners, "machine_name", lambda: "the machine of who cancels")
        done = toy.main("batch", "cancel", HUMANMM_CACHE=str(toy.folder / "cache"))
    assert done[0] == 0 and "1 on other machines end within a minute" in done[2], done
    assert worker.wait(timeout=60) == -signal.SIGTERM
    _close(worker)
    assert counts(table.rows("test")) == {"cancelled": 1}


def test_a_process_that_was_suspended_beyond_its_lease_ends_when_another_machine_has_its_video(
    toy: Any, table: BatchTable
) -> None:
    _submit(toy, table, "a.mp4")
    worker = _worker(toy)
    worker.send_signal(signal.SIGSTOP)
    (row,) = table.rows("test")
    assert row.is_owned, "a suspended process of this machine lives"
    successor = str(replace(owners.Owner.this_process(), machine="another"))
    assert table.change(row, attempt=2, owner=successor)
    worker.send_signal(signal.SIGCONT)
    assert worker.wait(timeout=60) == -signal.SIGTERM
    _close(worker)
    (now,) = table.rows("test")
    assert (now.attempt, now.state, now.owner) == (2, "running", successor)


def _close(worker: subprocess.Popen[str]) -> None:
    worker.wait()
    if worker.stdout is not None:
        worker.stdout.close()


def test_a_fault_of_the_store_has_a_video_tried_again_and_one_of_the_video_does_not(
    toy: Any, table: BatchTable
) -> None:
    _submit(toy, table, "a.mp4")
    for attempt in (1, 2, 3):
        (row,) = table.rows("test")
        assert (row.state, row.attempt, row.losses) == ("scheduled", attempt, attempt - 1)
        running = RunningVideo(table, row)
        with running.owned(None) as is_ours:
            assert is_ours
            running.fail(StoreError("the disk is full"))
    (row,) = table.rows("test")
    assert (row.state, row.attempt, row.reason) == ("failed", 3, "the disk is full")
    (row,) = batches.retry(table, "test")
    running = RunningVideo(table, row)
    with running.owned(None):
        running.fail(StageError("nobody is in it"))
    (row,) = table.rows("test")
    assert (row.state, row.attempt, row.reason) == ("failed", 4, "nobody is in it")


def test_a_video_that_its_own_file_failed_is_tried_again_when_the_file_is_another(toy: Any, table: BatchTable) -> None:
    for error, opened, again in (
        (NoUsablePersonError("nobody is in it"), True, False),
        (VideoError("it ends inside its header"), True, False),
        (VideoError("cannot read it: permission denied"), False, True),
        (StageError("the solve has no solution"), True, True),
    ):
        (row,) = batches.retry(table, "test") if table.rows("test") else _submit(toy, table, "a.mp4")
        running = RunningVideo(table, row)
        with running.owned(None):
            running.run = toy.run() if opened else None
            running.fail(error)
        (row,) = table.rows("test")
        assert (row.state, row.fails_again) == ("failed", not again)
        if not again:
            assert not batches.retry(table, "test")
            Path(row.video).write_bytes(Path(row.video).read_bytes() + b" ")
            assert not table.rows("test")[0].fails_again


@pytest.mark.parametrize(
    ("faults", "ended"), [("camera:20=disk:9", "scheduled"), ("camera:20=disk:9;hmr:40=stage", "partial")]
)
def test_a_video_is_tried_again_if_nothing_but_faults_of_the_machine_took_its_shots(
    toy: Any, table: BatchTable, monkeypatch: pytest.MonkeyPatch, faults: str, ended: str
) -> None:
    (row,) = _submit(toy, table, "a.mp4")
    monkeypatch.setenv("TOY_FAIL", faults)
    running = RunningVideo(table, row)
    with running.owned(None):
        running.run = toy.run(expect_failure=True)
        running.end_partial("camera · shot 1: Input/output error")
    (row,) = table.rows("test")
    assert (row.state, row.stage) == (ended, "camera · shot 1")


def test_the_stage_that_is_named_is_the_one_whose_error_is_told(
    toy: Any, table: BatchTable, monkeypatch: pytest.MonkeyPatch
) -> None:
    (row,) = _submit(toy, table, "a.mp4")
    monkeypatch.setenv("TOY_FAIL", "camera:0=stage;camera:20=stage;camera:40=stage")
    running = RunningVideo(table, row)
    with running.owned(None):
        running.run = toy.run(expect_failure=True)
        error = running.run.outcomes["camera", 1].error
        assert error is not None
        running.fail(error)
    (row,) = table.rows("test")
    assert (row.stage, row.reason) == ("camera · shot 1", "camera:20 cannot be done")


def test_a_cancelled_video_does_not_start_and_stays_cancelled(toy: Any, table: BatchTable) -> None:
    a, b = _submit(toy, table, "a.mp4", "b.mp4")
    table.change(a, state="cancelled")
    with RunningVideo(table, a).owned(None) as is_ours:
        assert not is_ours
    running = RunningVideo(table, b)
    with running.owned(None) as is_ours:
        assert is_ours
        table.change(b, state="cancelled")
        running.end("failed", "it was stopped")
    assert counts(table.rows("test")) == {"cancelled": 2}


def test_a_disk_that_is_full_for_a_while_costs_a_video_no_attempt(
    toy: Any, table: BatchTable, monkeypatch: pytest.MonkeyPatch
) -> None:
    (row,) = _submit(toy, table, "a.mp4")
    full = 0
    update = table._update

    def updated(*given: Any, **values: Any) -> bool:
        nonlocal full
        full -= 1
        if full >= 0:
            raise StoreError("the disk is full")
        return update(*given, **values)

    monkeypatch.setattr(table, "_update", updated)
    monkeypatch.setattr(running_video, "WAITS_S", (0.0, 0.0, 0.0))
    running = RunningVideo(table, row)
    full = 3
    with running.owned("run") as is_ours:
        assert is_ours
        full = 3
        running.end("done", "")
        full = 3
    (ended,) = table.rows("test")
    assert (ended.state, ended.attempt, ended.losses) == ("done", 1, 0) and ended.seconds is not None
    full = 4
    with pytest.raises(StoreError, match="disk is full"), running.owned("run"):
        raise AssertionError("it cannot be recorded that it runs")


def test_losses_are_counted_anew_when_a_video_has_got_further(
    toy: Any, table: BatchTable, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(running_video, "LOOK_EVERY_S", 0.01)
    _submit(toy, table, "a.mp4")
    (row,) = table.rows("test")
    for left in (0, 2):  # `decode` is computed the first time, and only found the second
        table.change(row, losses=2)
        running = RunningVideo(table, replace(row, losses=2))
        with running.owned(None):
            running.run = toy.open()
            running.run.execute(running.run.unit("decode"))
            time.sleep(1.0)
        assert table.rows("test")[0].losses == left
