"""Where stages compute: in threads of the flow's process, in children of it, or on workers of Dask or Ray.

A stage stays a task of the flow wherever it computes: its name, state and retries, the run's budget, the slot of the
limit `gpu` and the log are the flow's, and only a `Job` goes to a worker. So a worker needs humanmm, the store and the
video, but not Prefect or its server, and all runners are the same to whoever watches. (Prefect's own task runners for
both engines move the whole task: its retries would know nothing of the budget, a worker that dies would leave it
`Running`, and every worker would talk to the server.)
"""

import importlib.util
import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Protocol

from humanmm.config import RunConfig
from humanmm.errors import ConfigError
from humanmm.tasks.engine.faults import portable
from humanmm.tasks.engine.job import Done, Job, LogSender, Message, Progress, Setting, answer
from humanmm.tasks.engine.runners.processes import Children
from humanmm.tasks.process import prepare_process

PROGRESS_EVERY_S = 0.5
"""A worker tells how far it is no more often."""

_LIBRARIES = {"dask": "distributed", "ray": "ray"}


class Workers(Protocol):
    """Processes that do jobs for one run."""

    def open(self) -> None:
        """Start what jobs need, if that was not done before; from one thread at a time. ResourceError if it cannot."""
        ...

    def compute(self, job: Job, label: str, *, isolated: bool, limit_s: float | None, progress: Progress) -> Done:
        """Have a job done. TimeLimitError if it took too long, ResourceError if its process died, else its own error.

        With `isolated` or a limit it is done by a process that does nothing else, and that can be ended.
        """
        ...

    def close(self) -> None:
        """End all that still compute, and what was started for them; nothing is asked for after it."""
        ...


def workers_of(setting: Setting) -> Workers:
    """The processes that the settings ask for; none is started before there is a job."""
    run = setting.config.run
    if run.runner == "dask":
        from humanmm.tasks.engine.runners.dask_runner import DaskWorkers

        return DaskWorkers(setting, num_workers=run.threads, address=run.cluster)
    if run.runner == "ray":
        from humanmm.tasks.engine.runners.ray_runner import RayWorkers

        return RayWorkers(setting, num_workers=run.threads, address=run.cluster)
    return Children(setting)


def check_runner(run: RunConfig) -> None:
    """ConfigError if what `run.runner` names is not installed."""
    library = _LIBRARIES.get(run.runner)
    if library is not None and importlib.util.find_spec(library) is None:
        raise ConfigError(
            f"run.runner = {run.runner} needs a library that is not installed: pip install 'humanmm[{run.runner}]'"
        )


# ---- on a worker


def perform(
    setting: Setting, job: Job, label: str, *, isolated: bool, limit_s: float | None, send: Callable[[Message], None]
) -> Done | Exception:
    """Do a job in this process, or in a child of it; tells meanwhile how far it is and what it logs."""
    prepare_process()
    with _log_sent(send):
        told = _Seldom(send)
        if not isolated and limit_s is None:
            run = setting.open()
            run.listen(lambda work, done, total: told(done, total))
            with suppress(Exception):  # importing belongs to no stage's time; what is broken says so in its turn
                run.imports.function(run.stage(job.stage))
            return answer(run, job)
        children = Children(setting)
        try:
            return children.compute(job, label, isolated=True, limit_s=limit_s, progress=told)
        except Exception as error:
            return portable(error, label)
        finally:
            children.close()


class _Seldom:
    """Tells how far a stage is, now and then and at its end."""

    def __init__(self, send: Callable[[Message], None]) -> None:
        self._send = send
        self._told = 0.0

    def __call__(self, done: int, total: int) -> None:
        now = time.monotonic()
        if done == total or now - self._told > PROGRESS_EVERY_S:
            self._told = now
            self._send((done, total))


_at_work: set[int] = set()
"""Threads of this process that do jobs."""


@contextmanager
def _log_sent(send: Callable[[Message], None]) -> Iterator[None]:
    """Send what is logged by this thread, and by threads that do no job of their own."""
    own, logger = threading.get_ident(), logging.getLogger("humanmm")
    handler = LogSender(send)
    handler.addFilter(lambda record: threading.get_ident() == own or threading.get_ident() not in _at_work)
    _at_work.add(own)
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        _at_work.discard(own)
