"""Prefect's process worker for `humanmm serve`: `python -m humanmm.flows.service.worker POOL LIMIT NAME`.

It ends on a signal, and when its standard input ends, which it does when `humanmm serve` ends, however that came about.
Before that it stops its videos with SIGTERM and gives them time to note that they are to be resumed: Prefect's worker,
when it ends, kills them at once.
"""

import asyncio
import contextlib
import faulthandler
import os
import signal
import sys
import threading
import time
import uuid
from collections.abc import Coroutine
from types import FrameType
from typing import Any

from humanmm.flows.server.local_server import hold_port_of_server
from humanmm.flows.service.fork_server import launch
from humanmm.flows.service.video_processes import MARK, videos_of
from humanmm.signals import STOP_SIGNALS

SETTINGS = {"PREFECT_WORKER_QUERY_SECONDS": "2"}
"""Of the worker and its videos, in place of Prefect's."""
VIDEOS_LIMIT_S = 20.0
"""Seconds between SIGTERM and SIGKILL for a video."""
END_LIMIT_S = 10.0
"""Seconds that Prefect's worker may take to end, once its videos have. At the exit of Python, Prefect waits without a
limit until the server has all events, and `multiprocessing` until each child has ended: with a server that does not
respond the worker would stay for minutes or for ever."""


def main(pool: str, limit: str, name: str) -> None:
    """Work until a signal stops it or standard input ends."""
    os.environ.update(SETTINGS)  # which the videos inherit
    os.environ.setdefault(MARK, uuid.uuid4().hex)
    hold_port_of_server()
    launch()
    threading.Thread(target=_stop_at_end_of_input, daemon=True).start()
    from humanmm.flows.service import video_worker  # imports Prefect, as the fork server does meanwhile

    asyncio.run(_until_stopped(video_worker.work(pool, int(limit), name)))


def _stop_at_end_of_input() -> None:
    while os.read(sys.stdin.fileno(), 1):  # not through `sys.stdin`: a reader of it cannot be left at exit
        pass
    os.kill(os.getpid(), signal.SIGUSR1)


async def _until_stopped(work: Coroutine[Any, Any, None]) -> None:
    loop, task = asyncio.get_running_loop(), asyncio.ensure_future(work)

    def stop(number: int, frame: FrameType | None) -> None:
        """Runs in the main thread, so that Prefect's loop stands still and begins no other video meanwhile."""
        for again in STOP_SIGNALS:  # a supervisor may send several
            signal.signal(again, lambda *_: None)
        stop_videos(os.environ[MARK])
        faulthandler.dump_traceback_later(END_LIMIT_S, exit=True)  # the log then says where it hung
        loop.call_soon_threadsafe(task.cancel)

    for number in STOP_SIGNALS:
        signal.signal(number, stop)
    with contextlib.suppress(asyncio.CancelledError):
        await task


def stop_videos(mark: str) -> None:
    """Stop the videos of the workers with a mark, also of one that is gone."""
    videos = videos_of(mark)
    for number, limit_s in ((signal.SIGTERM, VIDEOS_LIMIT_S), (signal.SIGKILL, 1.0)):
        for video in videos:
            with contextlib.suppress(ProcessLookupError):
                os.kill(video, number)
        deadline = time.monotonic() + limit_s
        while (videos := [pid for pid in videos if pid in videos_of(mark)]) and time.monotonic() < deadline:
            time.sleep(0.1)


if __name__ == "__main__":
    main(*sys.argv[1:])
