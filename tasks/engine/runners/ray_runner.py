"""Stages on workers of Ray: on an instance that this process starts on this machine, or on a running cluster."""

import logging
import os
import queue
import shutil
import socket
import tempfile
import threading
from collections.abc import Iterator
from typing import Any

from humanmm.errors import ResourceError
from humanmm.tasks.engine.runners.job import Job, Message, Progress, Setting, receive
from humanmm.tasks.engine.runners.worker import perform
from humanmm.tasks.units.execute import Result
from humanmm.tasks.units.faults import in_words

OBJECTS_BYTES = 100 << 20
"""Shared memory of our own instance: nothing large goes through it."""

CONNECT_S = 10.0
LOOPBACK_ONLY = "RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"
"""Environment variable: with 0 Ray takes 127.0.0.1 as it is, and then listens there alone; on Linux it would otherwise
put an address in its place that other machines can reach, and listen everywhere."""


class RayWorkers:
    """`runner.Workers` of Ray; a job is a Ray task with the name that it has in the flow; it yields messages."""

    def __init__(self, setting: Setting, *, num_workers: int, address: str | None) -> None:
        self._setting = setting
        self._num_workers = num_workers
        self._address = address
        self._is_open = False

    def open(self) -> None:
        if not self._is_open:
            _Instance.join(self._num_workers, self._address)
            self._is_open = True

    def compute(self, job: Job, label: str, *, isolated: bool, limit_s: float | None, progress: Progress) -> Result:
        import ray

        task: Any = ray.remote(num_returns="streaming", max_retries=0)(_perform)
        try:
            for message in task.options(name=label).remote(self._setting, job, label, isolated, limit_s):
                received: Message = ray.get(message)
                if isinstance(received, Result):
                    return received
                if isinstance(received, Exception):
                    raise received
                receive(received, progress)
        except ray.exceptions.RayTaskError:
            raise
        except (ray.exceptions.RayError, OSError) as error:
            raise ResourceError(f"{label}: its worker was lost: {in_words(error)}") from error
        raise ResourceError(f"{label}: its worker was lost before it sent a result")

    def close(self) -> None:
        if self._is_open:
            self._is_open = False
            _Instance.leave()


class _Instance:
    """The cluster of this process: Ray connects a process to one, which its concurrent runs share."""

    _lock = threading.Lock()
    _users = 0
    _is_ours = False
    """Whether we connected; a program that has Ray already keeps its own."""
    _folder: str | None = None

    @classmethod
    def join(cls, num_workers: int, address: str | None) -> None:
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        if address is None:
            os.environ.setdefault(LOOPBACK_ONLY, "0")  # read when Ray is imported
        import ray

        with cls._lock:
            if cls._users == 0 and not ray.is_initialized():
                try:
                    cls._connect(num_workers, address)
                except Exception as error:  # Ray has no class for what can happen here
                    place = "on this machine" if address is None else f"at run.cluster = {address}"
                    raise ResourceError(f"no Ray {place}: {in_words(error)}") from error
                cls._is_ours = True
            cls._users += 1

    @classmethod
    def _connect(cls, num_workers: int, address: str | None) -> None:
        import ray

        quiet = {"log_to_driver": False, "logging_level": logging.ERROR}
        if address is not None:
            host, _, port = address.rpartition(":")
            if port.isdecimal():  # Ray retries a dead address for minutes
                socket.create_connection((host, int(port)), timeout=CONNECT_S).close()
            ray.init(address=address, **quiet)
            return
        cls._folder = tempfile.mkdtemp(prefix="hmm-ray-")
        ray.init(
            address="local",
            num_cpus=num_workers,
            include_dashboard=False,
            _node_ip_address="127.0.0.1",
            object_store_memory=OBJECTS_BYTES,
            _temp_dir=cls._folder,
            **quiet,
        )

    @classmethod
    def leave(cls) -> None:
        import ray

        with cls._lock:
            cls._users -= 1
            if cls._users == 0 and cls._is_ours:
                cls._is_ours = False
                ray.shutdown()
                if cls._folder is not None:
                    shutil.rmtree(cls._folder, ignore_errors=True)
                    cls._folder = None


def _perform(setting: Setting, job: Job, label: str, isolated: bool, limit_s: float | None) -> Iterator[Message]:
    """A task of Ray."""
    messages: queue.SimpleQueue[Message] = queue.SimpleQueue()

    def compute() -> None:
        messages.put(perform(setting, job, label, isolated=isolated, limit_s=limit_s, send=messages.put))

    threading.Thread(target=compute, name=label, daemon=True).start()
    while True:
        message = messages.get()
        yield message
        if isinstance(message, Result | Exception):
            return
