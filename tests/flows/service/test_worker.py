"""A worker ends in time after a signal or the end of its input, whatever its server and its videos do."""

import contextlib
import json
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from humanmm.flows.service.fork_server import VIDEO
from humanmm.flows.service.worker import END_LIMIT_S, STOP_LIMIT_S

pytestmark = [pytest.mark.server, pytest.mark.timeout(600)]


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
        assert time.monotonic() - began < STOP_LIMIT_S + END_LIMIT_S + 5
        assert not Path(f"/proc/{video}/exe").exists()
    finally:
        with contextlib.suppress(ProcessLookupError):  # `humanmm serve` kills it after a while
            os.kill(server, signal.SIGCONT)
