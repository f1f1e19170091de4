"""Prefect's process worker, asking its server for videos while it has room for one."""

import asyncio
import contextlib
import os
import time
import warnings

from prefect.client.schemas.objects import FlowRun
from prefect.utilities.processutils import setup_signal_handlers_worker
from prefect.workers.process import ProcessWorker

FULL_S = 30.0
"""How often a worker without room asks nevertheless: the dashboard calls a pool ready whose worker asks each minute."""

with warnings.catch_warnings(action="ignore"):  # it takes the place of Prefect's own, whose pools it works for

    class VideoWorker(ProcessWorker):
        """Every question costs the server ten milliseconds; videos take minutes, in which none can begin."""

        _asked = 0.0

        async def get_and_submit_flow_runs(self) -> list[FlowRun]:
            """Begin what waits, as far as there is room."""
            if self.limiter.available_tokens < 1 and time.monotonic() - self._asked < FULL_S:
                return []
            self._asked = time.monotonic()
            return await super().get_and_submit_flow_runs()


async def work(pool: str, limit: int, name: str) -> None:
    """Work for a pool until a signal ends it."""
    worker = VideoWorker(work_pool_name=pool, limit=limit, name=name)
    setup_signal_handlers_worker(os.getpid(), "the worker", print)
    with contextlib.suppress(asyncio.CancelledError):  # by the signal
        await worker.start()
