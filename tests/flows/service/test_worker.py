"""A worker ends in time after a signal or the end of its input, whatever its server and its videos do."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from humanmm.flows.service.video_processes import MARK, VIDEO
from humanmm.flows.service.worker import END_LIMIT_S, VIDEOS_LIMIT_S, stop_videos

ROOT = Path(__file__).resolve().parents[3]
NAMED = """
import time
from humanmm.tasks.units.process import name_process
name_process(%r)
time.sleep(600)
"""


@pytest.fixture
def videos() -> Iterator[Callable[[str], subprocess.Popen[bytes]]]:
    """Starts processes named like those of videos, all in the session of this test, for workers with a mark."""
    begun: list[subprocess.Popen[bytes]] = []

    def start(mark: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-c", NAMED % VIDEO]
        begun.append(subprocess.Popen(command, env={**os.environ, MARK: mark, "PYTHONPATH": str(ROOT / "src")}))
        while Path(f"/proc/{begun[-1].pid}/comm").read_text().strip() != VIDEO:
            time.sleep(0.01)
        return begun[-1]

    yield start
    for process in begun:
        process.kill()
        process.wait()


def test_a_worker_stops_its_own_videos_and_no_others_of_its_session(
    videos: Callable[[str], subprocess.Popen[bytes]],
) -> None:
    own, of_another = videos("one"), videos("two")
    stop_videos("one")
    assert own.wait(timeout=10) == -signal.SIGTERM
    assert of_another.poll() is None


@pytest.mark.server
@pytest.mark.timeout(600)
@pytest.mark.parametrize("any_toy", ["disk"], indirect=True)
def test_a_worker_whose_server_does_not_respond_ends_after_sigterm_with_its_video(
    farm: Any, place: Any, states: Callable[[], dict[str, dict[str, Any]]]
) -> None:
    done = farm.command("batch", "submit", "films", "--limit", "1", TOY_SLEEP="align=600")
    assert done.returncode == 0, done.stderr
    place.until(lambda: "align" in {video["stage"] for video in states().values()}, 120)
    (worker,), (video,) = place.pids("humanmm.flows.service.worker"), place.pids(VIDEO)
    server = json.loads(next(place.folder.glob("prefect-*/server.json")).read_text())["pid"]
    os.kill(server, signal.SIGSTOP)
    try:
        began = time.monotonic()
        os.kill(worker, signal.SIGTERM)
        place.until(lambda: not Path(f"/proc/{worker}/exe").exists(), 120)
        assert time.monotonic() - began < VIDEOS_LIMIT_S + END_LIMIT_S + 5
        assert not Path(f"/proc/{video}/exe").exists()
    finally:
        with contextlib.suppress(ProcessLookupError):  # `humanmm serve` kills it after a while
            os.kill(server, signal.SIGCONT)
