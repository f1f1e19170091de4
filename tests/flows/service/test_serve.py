"""`humanmm serve` on a full disk, with a wrong setting, and when a signal stops it, also before it is up."""

import contextlib
import errno
import os
import resource
import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import httpx
import pytest

from humanmm.flows.server.local_server import ServerFiles
from humanmm.flows.service import serve
from humanmm.storage.batches.batch_table import open_batches
from humanmm.storage.batches.video_row import VideoRow


def test_it_waits_for_room_on_a_full_disk_and_then_starts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    free = iter([0, 1 << 20, 1 << 40])
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: SimpleNamespace(free=next(free)))
    monkeypatch.setattr(serve, "LOOK_EVERY_S", 0.0)
    assert serve._has_room(ServerFiles(tmp_path), threading.Event())
    assert [record.getMessage().split(" are free")[0] for record in caplog.records] == ["0 MB", "1 MB"]


def test_it_can_be_stopped_while_it_waits_for_room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: SimpleNamespace(free=0))
    leave = threading.Event()
    leave.set()
    assert not serve._has_room(ServerFiles(tmp_path), leave)


@pytest.mark.parametrize(
    "fault", [OSError(errno.ENOSPC, "No space left on device"), httpx.ConnectError("All connection attempts failed")]
)
def test_a_disk_that_fills_up_or_a_server_that_dies_while_it_starts_does_not_end_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, fault: Exception
) -> None:
    faults: Iterator[Exception] = iter([fault, fault])
    monkeypatch.setenv("HUMANMM_CACHE", str(tmp_path))
    monkeypatch.setattr(serve, "LOOK_EVERY_S", 0.0)

    def begin(*_: object) -> None:
        for one in faults:
            raise one

    monkeypatch.setattr(serve, "_serve_until_told", begin)
    serve.serve(limit=1)
    assert sum("humanmm serve starts again" in record.getMessage() for record in caplog.records) == 2
    monkeypatch.setattr(serve, "_serve_until_told", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        serve.serve(limit=1)


def test_a_store_whose_batches_cannot_be_read_is_not_shown_and_the_others_are(
    toy: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    damaged, table = tmp_path / "damaged", open_batches(toy.store)
    damaged.mkdir()
    (damaged / "batches.sqlite").write_bytes(b"garbage" * 100)
    table.put([VideoRow("b", "v.mp4", 0, "/runs/v", "{}", "normal", "[]", "", "")])
    shown: list[str] = []
    monkeypatch.setattr("humanmm.flows.server.dashboard.show_batch", lambda client, name, rows: shown.append(name))
    files = ServerFiles(tmp_path)
    files.stores.write_text(f"{damaged}\n{toy.store}\n")
    serve.BatchTables(cast(Any, None)).update(files)
    assert shown == ["b"]


@pytest.mark.parametrize("has_videos", [False, True])
def test_it_leaves_when_nothing_runs_also_if_every_look_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, has_videos: bool
) -> None:
    looks: list[float] = []

    def fail(files: ServerFiles) -> int:
        looks.append(time.monotonic())
        if len(looks) == 20:
            leave.set()
        raise httpx.ConnectError("no server")

    leave = threading.Event()
    monkeypatch.setattr(serve, "LOOK_EVERY_S", 0.01)
    monkeypatch.setattr(serve, "ensure_server", lambda files: True)
    monkeypatch.setattr(serve, "resume_lost_videos", fail)
    monkeypatch.setenv("PREFECT_API_URL", "http://127.0.0.1:1/api")
    monkeypatch.setattr("prefect.get_client", lambda **kind: contextlib.nullcontext())
    worker: Any = SimpleNamespace(keep_up=lambda: None, has_videos=has_videos)
    serve._look_after(ServerFiles(tmp_path), worker, leave, idle_s=0.03)
    assert leave.is_set() == has_videos, "its videos go on"


@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGUSR1"])
def test_signals_stop_it_in_order(number: str) -> None:
    leave = threading.Event()
    before = signal.getsignal(signal.Signals[number])
    with serve._signals(leave):
        os.kill(os.getpid(), signal.Signals[number])
        deadline = time.monotonic() + 10
        while not leave.is_set() and time.monotonic() < deadline:
            time.sleep(0.01)
        assert leave.is_set()
    assert signal.getsignal(signal.Signals[number]) == before


@pytest.mark.server
@pytest.mark.timeout(600)
@pytest.mark.parametrize("any_toy", ["disk"], indirect=True)
@pytest.mark.parametrize("verb", ["serve", "recover film.mp4", "batch submit films"])
def test_a_variable_that_prefect_refuses_is_reported_within_five_seconds(farm: Any, place: Any, verb: str) -> None:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = farm.command(*verb.split(), PREFECT_SERVER_API_PORT="high")
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent_s = spent.ru_utime + spent.ru_stime - before.ru_utime - before.ru_stime
    assert spent_s < 5, "processor time: a busy machine lets nobody begin"
    assert done.returncode == 1 and done.stdout == ""
    (line,) = [line for line in done.stderr.splitlines() if "PREFECT" in line]
    assert line.startswith("humanmm: PREFECT_SERVER_API_PORT = 'high': "), done.stderr
    assert place.pids("humanmm.flows.") == []


@pytest.fixture
def small_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A disk of 200 MB at the cache folder of `place`."""
    folder = tmp_path / "cache"
    folder.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=200m,mode=700", "tmpfs", str(folder)], capture_output=True, check=False
    )
    if mounted.returncode != 0:
        pytest.skip("this process may not mount a small disk")
    yield folder
    subprocess.run(["umount", "--lazy", str(folder)], check=True)


@pytest.mark.server
@pytest.mark.timeout(600)
@pytest.mark.parametrize("any_toy", ["disk"], indirect=True)
def test_on_a_full_disk_it_starts_once_there_is_room(small_disk: Path, farm: Any, place: Any) -> None:
    filler = small_disk / "filler"
    with contextlib.suppress(OSError), filler.open("wb", buffering=0) as file:
        while True:  # to the last byte: ENOSPC ends it
            file.write(bytes(1 << 20))
    log = (farm.folder / "log").open("w")
    with (
        log,
        subprocess.Popen(
            farm.command_line("serve"), env=farm.environment(), stdout=subprocess.DEVNULL, stderr=log
        ) as serving,
    ):
        place.until(lambda: "the server starts when it has 32" in (farm.folder / "log").read_text(), 60)
        assert serving.poll() is None and place.pids("humanmm.flows.server") == []
        filler.unlink()
        place.until(lambda: list(place.folder.glob("prefect-*/serving")), 90)
        serving.terminate()
        assert serving.wait(timeout=120) == 0


@pytest.mark.server
@pytest.mark.timeout(600)
@pytest.mark.parametrize("any_toy", ["disk"], indirect=True)
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_stopped_while_its_server_is_not_up_it_ends_with_it(farm: Any, place: Any, number: int) -> None:
    (farm.folder / "sitecustomize.py").write_text(
        "import sys, time\nif any('server_process' in part for part in sys.orig_argv):\n    time.sleep(600)\n"
    )
    with subprocess.Popen(farm.command_line("serve"), env=farm.environment(), stdout=subprocess.DEVNULL) as serving:
        place.until(lambda: place.pids("humanmm.flows.server.server_process"), 60)
        serving.send_signal(number)
        began = time.monotonic()
        assert serving.wait(timeout=60) == 0
        assert time.monotonic() - began < 20
    assert place.pids("humanmm.flows.") == []
