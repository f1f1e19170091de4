"""Stages on workers of Dask: on a cluster that this run starts on this machine, or on one that runs already."""

import logging
import pickle
import uuid
from typing import Any

from humanmm.errors import ResourceError
from humanmm.tasks.engine.runners.job import Job, Message, Progress, Setting, receive
from humanmm.tasks.engine.runners.worker import perform
from humanmm.tasks.units.execute import Result
from humanmm.tasks.units.faults import in_words

TOPIC = "humanmm"
"""Topic of the workers' messages, which the scheduler forwards in order; one for all runs, for it keeps topics."""


class DaskWorkers:
    """`runner.Workers` of a Dask scheduler; a job is a Dask task with the name that it has in the flow."""

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
            self._client.subscribe_topic(TOPIC, self._receive)

    def compute(self, job: Job, label: str, *, isolated: bool, limit_s: float | None, progress: Progress) -> Result:
        from distributed import CancelledError, KilledWorker

        client = self._client
        key = f"{label}-{uuid.uuid4().hex}"
        self._progress[key] = progress
        try:
            task = client.submit(
                _perform, self._setting, job, label, isolated, limit_s, key, key=key, pure=False, retries=0
            )
            received: Result | Exception = task.result()
        except (KilledWorker, CancelledError, OSError) as error:
            raise ResourceError(f"{label}: its worker was lost: {in_words(error)}") from error
        finally:
            del self._progress[key]
        if isinstance(received, Exception):
            raise received
        return received

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
        with dask.config.set({"distributed.scheduler.allowed-failures": 0}):  # the flow retries
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

    def _receive(self, event: tuple[float, tuple[str, bytes]]) -> None:
        key, message = event[1]
        progress = self._progress.get(key)
        if progress is not None:  # of this run
            receive(pickle.loads(message), progress)


def _perform(setting: Setting, job: Job, label: str, isolated: bool, limit_s: float | None, key: str) -> Any:
    """A task of Dask."""
    from distributed import get_worker

    worker = get_worker()

    def send(message: Message) -> None:
        worker.log_event(TOPIC, (key, pickle.dumps(message)))

    return perform(setting, job, label, isolated=isolated, limit_s=limit_s, send=send)
