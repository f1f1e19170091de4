"""Prefect's process worker for `humanmm serve`: `python -m humanmm.flows.service.worker POOL LIMIT NAME`.

It leaves when its standard input ends, which it does when `humanmm serve` ends, however that came about. Its videos are
told first, and have time to note that they are to be resumed: Prefect's worker, when it leaves, kills them outright.
Beside it runs a template of the processes of its videos (`humanmm.flows.service.fork_server`).
"""

import asyncio
import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
import uuid
from pathlib import Path
from types import FrameType

from humanmm.flows.service.video_process import TEMPLATE

SETTINGS = {"PREFECT_WORKER_QUERY_SECONDS": "2", "PREFECT_FLOWS_HEARTBEAT_FREQUENCY": "30"}
"""Of the worker and its videos, in place of Prefect's."""
STOP_LIMIT_S = 20.0
"""How long videos may take to stop before they are killed."""
PAUSE_S = 2.0
"""Before another template is started: one that cannot import its code ends at once."""


def main(pool: str, limit: str, name: str) -> None:
    """Work until told to stop or until standard input ends."""
    signal.signal(signal.SIGUSR1, _leave)
    threading.Thread(target=_leave_at_end_of_input, daemon=True).start()
    # Prefect passes our environment on to the videos
    os.environ.update(SETTINGS, **{TEMPLATE: f"humanmm-{uuid.uuid4().hex}"})
    threading.Thread(target=_keep_template, daemon=True).start()
    from humanmm.flows.service import video_worker  # imports Prefect, which the template has been told to do meanwhile

    asyncio.run(video_worker.work(pool, int(limit), name))


def _leave_at_end_of_input() -> None:
    while os.read(sys.stdin.fileno(), 1):  # not through `sys.stdin`: a reader of it cannot be left at exit
        pass
    os.kill(os.getpid(), signal.SIGUSR1)


def _leave(number: int, frame: FrameType | None) -> None:
    """Runs in the main thread, so that Prefect's loop stands still and begins no other video meanwhile."""
    stop_session(os.getsid(0))
    os.kill(os.getpid(), signal.SIGTERM)


def stop_session(session: int) -> None:
    """Have the videos of a worker stop, also of one that is gone: each is a process of its session."""
    videos = _others_in(session)
    for number, limit_s in ((signal.SIGTERM, STOP_LIMIT_S), (signal.SIGKILL, 1.0)):
        for video in videos:
            with contextlib.suppress(ProcessLookupError):
                os.kill(video, number)
        deadline = time.monotonic() + limit_s
        while (videos := [pid for pid in videos if pid in _others_in(session)]) and time.monotonic() < deadline:
            time.sleep(0.1)


def _others_in(session: int) -> list[int]:
    """Living processes of a session, without this one and the session's own."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError, ValueError, IndexError):
            state, _, _, its_session = stat.read_text().rpartition(")")[2].split()[:4]
            if int(its_session) == session and state not in "ZX":
                found.append(int(stat.parent.name))
    return [pid for pid in found if pid not in (session, os.getpid())]


def _keep_template() -> None:
    """Have a template, and another one when that forks no more; a video that finds none starts by itself."""
    command = [sys.executable, "-m", "humanmm.flows.service.fork_server", os.environ[TEMPLATE]]
    template = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert template.stdin is not None and template.stdout is not None
    template.stdout.read()  # ends when it forks no more: it was killed, or its code has changed
    time.sleep(PAUSE_S)
    threading.Thread(target=_keep_template, daemon=True).start()
    template.stdin.close()
    template.wait()  # for as long as its forks take


if __name__ == "__main__":
    main(*sys.argv[1:])
