"""Prefect's process worker: it queries its server while it has room for a video, and forks the process of each."""

import contextlib
import gc
import os
import signal
import time
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import anyio
import anyio.abc
from prefect.client.schemas.objects import FlowRun
from prefect.runner import _starter_engine
from prefect.runner._process_manager import ProcessHandle
from prefect.workers.process import ProcessWorker

from humanmm.flows.service import fork_server
from humanmm.tasks.units.process import release_memory

FULL_S = 30.0
"""Seconds between queries while there is no room: the dashboard calls a pool ready whose worker queries each minute."""
_ONE_AT_A_TIME = anyio.CapacityLimiter(1)
"""`multiprocessing` looks at all children whenever one starts: two threads would read one exit status twice."""

with warnings.catch_warnings(action="ignore"):  # it takes the place of Prefect's own, whose pools it works for

    class VideoWorker(ProcessWorker):
        """A query costs the server ten milliseconds; videos take minutes, in which none can begin."""

        _queried = 0.0

        async def get_and_submit_flow_runs(self) -> list[FlowRun]:
            """Begin what waits, as far as there is room."""
            if self.limiter.available_tokens < 1 and time.monotonic() - self._queried < FULL_S:
                return []
            self._queried = time.monotonic()
            return await super().get_and_submit_flow_runs()


async def run_in_fork(
    *,
    task_status: anyio.abc.TaskStatus[ProcessHandle],
    task_status_handler: Callable[[Any], ProcessHandle],
    env: Mapping[str, str],
    cwd: os.PathLike[str] | str | None,
    **_: object,
) -> None:
    """Prefect's `run_process`, which starts `python -m prefect.engine`, by a fork that runs the same engine.

    Only what differs from our own environment is sent. The process writes to the log of the worker itself.
    """
    changes: dict[str, str | None] = {name: value for name, value in env.items() if os.environ.get(name) != value}
    changes |= dict.fromkeys(os.environ.keys() - env.keys())
    folder = Path(cwd or ".").absolute()
    with anyio.CancelScope(shield=True):  # else nobody would know the process
        process = await anyio.to_thread.run_sync(fork_server.start, changes, folder, limiter=_ONE_AT_A_TIME)
    try:
        task_status.started(task_status_handler(process))
        await anyio.wait_readable(process.sentinel)
    except BaseException:
        assert process.pid is not None
        with contextlib.suppress(ProcessLookupError):
            os.kill(process.pid, signal.SIGTERM)  # as Prefect's `run_process` does
        raise
    await anyio.to_thread.run_sync(process.join, limiter=_ONE_AT_A_TIME)
    gc.collect()  # Python looks by itself after hundreds of videos: the worker would grow by a sixth until then
    release_memory()  # what a video leaves in pieces would grow for as long as the worker lives


async def work(pool: str, limit: int, name: str) -> None:
    """Work for a pool until cancelled."""
    gc.collect()
    gc.freeze()  # what is loaded stays, and need not be looked through after each video
    setattr(_starter_engine, "run_process", run_in_fork)  # noqa: B010  # where Prefect's docstring has it replaced
    await VideoWorker(work_pool_name=pool, limit=limit, name=name).start()
