"""One job on a worker of Dask or Ray: computed in the worker's process, or in a child of it that can be killed."""

import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from humanmm.tasks.engine.runners.job import Job, LogSender, Message, Setting, respond
from humanmm.tasks.engine.runners.processes import Children
from humanmm.tasks.units.execute import Result
from humanmm.tasks.units.faults import portable
from humanmm.tasks.units.process import prepare_process

PROGRESS_EVERY_S = 0.5
"""A worker sends progress no more often."""


def perform(
    setting: Setting, job: Job, label: str, *, isolated: bool, limit_s: float | None, send: Callable[[Message], None]
) -> Result | Exception:
    """Compute a job; sends its progress and its log records meanwhile."""
    prepare_process()
    with _log_sent(send):
        progress = _RareProgress(send)
        if not isolated and limit_s is None:
            executor = setting.open()
            executor.listen(lambda unit, done, total: progress(done, total))
            with suppress(Exception):  # imports count in no stage's time; a broken module fails in `respond`
                executor.imports.function(executor.stage(job.stage))
            return respond(executor, job)
        children = Children(setting)
        try:
            return children.compute(job, label, isolated=True, limit_s=limit_s, progress=progress)
        except Exception as error:
            return portable(error, label)
        finally:
            children.close()


class _RareProgress:
    """Sends progress every `PROGRESS_EVERY_S` and at the end."""

    def __init__(self, send: Callable[[Message], None]) -> None:
        self._send = send
        self._sent = 0.0

    def __call__(self, done: int, total: int) -> None:
        now = time.monotonic()
        if done == total or now - self._sent > PROGRESS_EVERY_S:
            self._sent = now
            self._send((done, total))


_busy: set[int] = set()
"""Threads of this process that compute jobs."""


@contextmanager
def _log_sent(send: Callable[[Message], None]) -> Iterator[None]:
    """Send the log records of this thread, and of threads that compute no job themselves."""
    own, logger = threading.get_ident(), logging.getLogger("humanmm")
    handler = LogSender(send)
    handler.addFilter(lambda record: threading.get_ident() == own or threading.get_ident() not in _busy)
    _busy.add(own)
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        _busy.discard(own)
