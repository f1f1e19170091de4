"""Computes stages in child processes: they can be killed, and the run survives that.

A thread cannot be stopped from outside, so a time limit on it cannot be enforced. When a child is killed, the kernel
frees its locks and its memory, and the artifact that it was writing never becomes visible. A child computes one unit
after another, so that it loads code and weights once; it ends by itself when its parent has ended.
"""

import contextlib
import logging
import os
import queue
import signal
import socket
import subprocess
import sys
import threading
import time
from typing import TYPE_CHECKING, Any

from humanmm.errors import HumanMMError, ResourceError, TimeLimitError
from humanmm.tasks.engine.runners.job import Job, LogSender, Progress, Setting, receive, respond
from humanmm.tasks.units.execute import Result
from humanmm.tasks.units.process import prepare_process

if TYPE_CHECKING:
    from multiprocessing.connection import Connection


START_LIMIT_S = 300.0
"""How long a child may take until it can compute, in seconds; far more than a slow disk needs to load the code."""
READY = "ready"
"""What a child sends when it can compute."""


class Children:
    """`runner.Workers` that are child processes: as many as the units of one video that compute at the same time."""

    def __init__(self, setting: Setting) -> None:
        self._setting = setting
        self._all: list[_Child] = []
        self._idle: list[_Child] = []
        self._closed = False
        self._lock = threading.Lock()

    def open(self) -> None:
        """Nothing: a child is started when there is a job and no idle child."""

    def compute(self, job: Job, label: str, *, isolated: bool, limit_s: float | None, progress: Progress) -> Result:
        child = self._idle_child()
        try:
            result = child.compute(job, label, limit_s, progress)
        except BaseException as error:
            fit = isinstance(error, HumanMMError) and not isinstance(error, TimeLimitError | ResourceError)
            self._keep(child) if fit else self._drop(child)
            raise
        self._keep(child)
        return result

    def close(self) -> None:
        """Kill all children, busy ones too; none is started after it."""
        with self._lock:
            self._closed = True
            for child in self._all:
                child.end()

    def _idle_child(self) -> "_Child":
        with self._lock:
            if self._closed:
                raise ResourceError("the run has ended")
            if self._idle:
                return self._idle.pop()
        child = _Child(self._setting)  # not under the lock: this takes a while
        with self._lock:
            self._all.append(child)
            if self._closed:
                child.end()
        return child

    def _keep(self, child: "_Child") -> None:
        with self._lock:
            self._idle.append(child)

    def _drop(self, child: "_Child") -> None:
        child.kill()
        with self._lock:
            self._all.remove(child)


class _Child:
    """One child process as its parent sees it."""

    def __init__(self, setting: Setting) -> None:
        from multiprocessing.connection import Connection

        ours, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-c", f"from {__name__} import main; main({theirs.fileno()})"],
                pass_fds=[theirs.fileno()], stdin=subprocess.DEVNULL, start_new_session=True,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            )  # fmt: skip
        self._connection = Connection(ours.detach())
        self._connection.send(setting)
        self._ready = False

    def compute(self, job: Job, label: str, limit_s: float | None, progress: Progress) -> Result:
        """Compute `job`; its limit does not count the time in which the child itself starts."""
        try:
            self._wait_until_ready(label, progress)
            deadline = None if limit_s is None else time.monotonic() + limit_s
            self._connection.send(job)
            while True:
                left = None if deadline is None else max(0.0, deadline - time.monotonic())
                if not self._connection.poll(left):
                    raise TimeLimitError(
                        f"{label} took longer than its limit of {limit_s:g} s and was ended; `run.limit_s` or "
                        f"`limit_s` under [run.stages.{job.stage}] sets another"
                    )
                message = self._connection.recv()
                if isinstance(message, Result):
                    return message
                if isinstance(message, Exception):
                    raise message
                receive(message, progress)
        except (EOFError, OSError) as error:
            raise ResourceError(f"{label}: its process was lost: {self._how_it_ended()}") from error

    def _wait_until_ready(self, label: str, progress: Progress) -> None:
        while not self._ready:
            if not self._connection.poll(START_LIMIT_S):
                raise ResourceError(f"{label}: its process did not start within {START_LIMIT_S:g} s")
            message = self._connection.recv()
            if message == READY:
                self._ready = True
            else:
                receive(message, progress)

    def kill(self) -> None:
        """Close the connection, then kill it and the processes that it has started."""
        self._connection.close()
        self.end()

    def end(self) -> None:
        """Kill it and the processes that it has started; a thread that waits for its messages gets an EOFError."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()

    def _how_it_ended(self) -> str:
        try:
            status = self._process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            return "it closed its connection"
        if status == -signal.SIGKILL:
            return "it was killed, most often because memory ran out"
        return f"it ended by signal {-status}" if status < 0 else f"it ended with status {status}"


# ---- in the child


def main(descriptor: int) -> None:
    """Compute jobs until the parent has ended."""
    from multiprocessing.connection import Connection

    prepare_process()
    connection = Connection(descriptor)
    sending = threading.Lock()

    def send(message: Any) -> None:
        with sending, contextlib.suppress(BrokenPipeError):
            connection.send(message)

    logger = logging.getLogger("humanmm")
    logger.setLevel(logging.INFO)
    logger.addHandler(LogSender(send))
    setting: Setting = connection.recv()
    executor = setting.open()
    executor.listen(lambda unit, done, total: send((done, total)))
    send(READY)
    jobs: queue.SimpleQueue[Job] = queue.SimpleQueue()
    threading.Thread(target=_receive, args=(connection, jobs), daemon=True).start()
    while True:
        send(respond(executor, jobs.get()))


def _receive(connection: "Connection", jobs: "queue.SimpleQueue[Job]") -> None:
    """Receive jobs while the main thread computes, so that the end of the parent is noticed at once."""
    while True:
        try:
            jobs.put(connection.recv())
        except (EOFError, OSError):
            os._exit(0)
