"""`humanmm serve` on a full disk, and when a signal stops it."""

import os
import shutil
import signal
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from humanmm.flows.server.local_server import ServerFiles
from humanmm.flows.service import serve


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
