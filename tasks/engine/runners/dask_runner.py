"""Stages on workers of Dask: a cluster of this run's own on this machine, or one that runs already."""

import logging
import pickle
import uuid
from typing import Any

from humanmm.errors import ResourceError
from humanmm.tasks.engine.faults import in_words
from humanmm.tasks.engine.job import Done, Job, Message, Progress, Setting, hear
from humanmm.tasks.engine.runners.runner import perform

log = logging.getLogger(__name__)

TOPIC = "humanmm"
"""Under which workers log messages, which the scheduler passes on in order; one for all runs, for it keeps topics."""


class DaskWorkers:
    """`runner.Workers` of a Dask scheduler; a job is a task there, named as in the flow."""

    def __init__(self, setting: Setting, *, num_workers: int, address: str | None) -> None:
        self._setting = setting
        self._num_workers = num_workers
        self._address = address
        self._cluster: Any = None
        self._client: Any = None
        self._progress: dict[str, Progress] = {}

    def open(self) -> None:
        if self._client is None:
            self._client = self._connect()
            self._client.subscribe_topic(TOPIC, self._hear)

    def compute(self, job: Job, label: str, *, isolated: bool, limit_s: float | None, progress: Progress) -> Done:
        from distributed import CancelledError, KilledWorker

        client = self._client
        key = f"{label}-{uuid.uuid4().hex}"
        self._progress[key] = progress
        try:
            task = client.submit(
                _perform, self._setting, job, label, isolated, limit_s, key, key=key, pure=False, retries=0
            )
            told: Done | Exception = task.result()
        except (KilledWorker, CancelledError, OSError) as error:
            raise ResourceError(f"{label}: its worker was lost: {in_words(error)}") from error
        finally:
            del self._progress[key]
        if isinstance(told, Exception):
            raise told
        return told

    def close(self) -> None:
        for opened in (self._client, self._cluster):
            if opened is not None:
                opened.close()

    def _connect(self) -> Any:
        import dask
        from distributed import Client, LocalCluster

        if self._address is not None:
            try:
                return Client(self._address, set_as_default=False)
            except OSError as error:
                message = f"no scheduler of Dask at run.cluster = {self._address}: {in_words(error)}"
                raise ResourceError(message) from error
        with dask.config.set({"distributed.scheduler.allowed-failures": 0}):  # who tries again is the flow
            self._cluster = LocalCluster(
                n_workers=self._num_workers,
                threads_per_worker=1,
                memory_limit=None,  # the run's budget is held by the flow
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",
                security=True,  # others on this machine may not use our workers
                silence_logs=logging.CRITICAL,
            )
        return Client(self._cluster, set_as_default=False)

    def _hear(self, event: tuple[float, tuple[str, bytes]]) -> None:
        key, message = event[1]
        progress = self._progress.get(key)
        if progress is not None:  # of this run
            hear(pickle.loads(message), progress)


def _perform(setting: Setting, job: Job, label: str, isolated: bool, limit_s: float | None, key: str) -> Any:
    """A task of Dask."""
    from distributed import get_worker

    worker = get_worker()

    def send(message: Message) -> None:
        worker.log_event(TOPIC, (key, pickle.dumps(message)))

    return perform(setting, job, label, isolated=isolated, limit_s=limit_s, send=send)
