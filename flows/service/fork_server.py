"""A process that has imported Prefect and all stages, and forks one for each video.

It computes nothing itself and has one thread, so that a fork of it is as good as a fresh process; what it has loaded
is in memory once. A video still has a process of its own, which ends with it and can be killed alone. A template whose
code was changed on the disk forks no more: the worker starts another one.
"""

import gc
import json
import logging
import os
import runpy
import selectors
import signal
import socket
import struct
import sys
import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from humanmm.flows.service.video_process import NUMBER
from humanmm.tasks.units.process import end_with_parent

log = logging.getLogger(__name__)

ASK_LIMIT_S = 10.0
"""How long one who asks may take to say what for."""


@dataclass(frozen=True)
class Asked:
    """What a fork is to be: the environment, the folder and the standard streams of the process that it stands for."""

    environment: dict[str, str]
    folder: str
    streams: tuple[int, int, int]


@dataclass(frozen=True)
class _Fork:
    pid: int
    ended: int
    """A descriptor that can be read when it has ended."""
    asker: socket.socket


def main(name: str) -> None:
    """Listen, import, fork; in a fork, run its flow run."""
    began_ns = time.time_ns()
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    listener.bind(f"\0{name}")
    listener.listen()  # who asks now waits until everything is imported
    import_everything()
    asked = Template(listener, began_ns).forks()
    if asked is not None:
        become(asked)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # the module was imported before
            runpy.run_module("prefect.engine", run_name="__main__")


def import_everything() -> None:
    """All that a video of a batch needs, so that its process imports nothing more."""
    from humanmm.tasks.units.process import prepare_process

    prepare_process()
    import prefect.flow_engine  # noqa: F401

    import humanmm.flows.batch
    import humanmm.storage.run_folder.motion_zarr
    import humanmm.tasks.pictures  # noqa: F401
    from humanmm.tasks import pipeline
    from humanmm.tasks.units.imports import Imports

    Imports(pipeline.STAGES).prepare(pipeline.STAGES[0])
    prepare_process()


class Template:
    """Forks for whoever asks at `listener`. Told to stop, or when standard input ends, it leaves after its forks.

    Its code was imported from `began_ns` (nanoseconds since 1970) until now.
    """

    def __init__(self, listener: socket.socket, began_ns: int) -> None:
        self._listener = listener
        self._loaded = loaded_files()
        now_ns = time.time_ns()
        self._is_mixed = any(began_ns <= changed_ns <= now_ns for changed_ns, _ in self._loaded.values())
        self._events = selectors.DefaultSelector()
        self._forks: set[_Fork] = set()

    def forks(self) -> Asked | None:
        """Serve; returns in each fork, with what is asked of it, and in the template when it is over."""
        told, tell = socket.socketpair()
        tell.setblocking(False)
        signal.set_wakeup_fd(tell.fileno())
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: None)  # `told` can be read
        gc.collect()
        gc.freeze()  # the collector would write to every page that the forks share
        for stream in (self._listener, told, sys.stdin):
            self._events.register(stream, selectors.EVENT_READ)
        while self._listener.fileno() >= 0 or self._forks:
            for key, _ in self._events.select():
                if key.data is not None:
                    self._look_at(key.data)
                elif key.fileobj is not self._listener:
                    self._events.unregister(key.fileobj)
                    self._stop_listening()
                elif self._listener.fileno() >= 0 and (asked := self._take()) is not None:
                    return asked
        return None

    def _take(self) -> Asked | None:
        """Fork for the next who asks; not None in the fork alone."""
        asker, _ = self._listener.accept()
        asker.settimeout(ASK_LIMIT_S)
        asked = _read(asker) if _is_ours(asker) else None
        if asked is None:
            asker.close()
        elif not self._is_fit():
            self._stop_listening()
            asker.close()  # who asked starts afresh
            _close(asked)
        else:
            return self._fork(asker, asked)
        return None

    def _fork(self, asker: socket.socket, asked: Asked) -> Asked | None:
        template = os.getpid()
        pid = os.fork()
        if pid == 0:
            end_with_parent(template)
            os.setsid()  # whom it stands for passes signals on: it gets none that is sent to the worker's session
            asker.close()
            self._forget()
            return asked
        fork = _Fork(pid, os.pidfd_open(pid), asker)
        self._forks.add(fork)
        self._events.register(fork.ended, selectors.EVENT_READ, fork)
        self._events.register(asker, selectors.EVENT_READ, fork)
        _tell(asker, pid)
        _close(asked)
        return None

    def _look_at(self, fork: _Fork) -> None:
        """It has ended, or who asked for it has."""
        if fork not in self._forks:
            return
        pid, status = os.waitpid(fork.pid, os.WNOHANG)
        if pid == 0:
            os.kill(fork.pid, signal.SIGKILL)
            _, status = os.waitpid(fork.pid, 0)
        _tell(fork.asker, status)
        self._forks.remove(fork)
        for descriptor in (fork.ended, fork.asker):
            self._events.unregister(descriptor)
        os.close(fork.ended)
        fork.asker.close()

    def _is_fit(self) -> bool:
        """Whether a fork would be as a fresh process is: the same code, and no thread that it would lack."""
        if self._is_mixed or loaded_files() != self._loaded:
            log.info("code that was loaded has changed on the disk")
            return False
        if len(os.listdir("/proc/self/task")) > 1:  # noqa: PTH208
            log.warning("a library has started a thread: videos are started without a template")
            return False
        return True

    def _stop_listening(self) -> None:
        if self._listener.fileno() >= 0:
            self._events.unregister(self._listener)
            self._listener.close()
            os.close(1)  # the worker sees it, and starts another template

    def _forget(self) -> None:
        """In a fork: nothing of the template stays open or is called."""
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        self._events.close()
        self._listener.close()
        for fork in self._forks:
            os.close(fork.ended)
            fork.asker.close()


def become(asked: Asked) -> None:
    """Take over the environment, the folder and the standard streams of the process that asked."""
    for target, stream in enumerate(asked.streams):
        os.dup2(stream, target)
        os.close(stream)
    os.environ.clear()
    os.environ.update(asked.environment)
    os.chdir(asked.folder)
    sys.argv = ["prefect.engine"]
    import prefect.context

    prefect.context.refresh_global_settings_context()


def loaded_files() -> Mapping[str, tuple[int, int]]:
    """The files of all modules that are imported, with their times and sizes."""
    files = {getattr(module, "__file__", None) for module in list(sys.modules.values())}
    found = {}
    for path in files:
        if isinstance(path, str):
            try:
                status = os.stat(path)  # noqa: PTH116
            except OSError:
                found[path] = (0, 0)
            else:
                found[path] = (status.st_mtime_ns, status.st_size)
    return found


def _read(asker: socket.socket) -> Asked | None:
    try:
        head, streams, _, _ = socket.recv_fds(asker, NUMBER.size, 3)
        length = NUMBER.unpack(head)[0]
        text = bytearray()
        while len(text) < length and (part := asker.recv(length - len(text))):
            text += part
        given: dict[str, Any] = json.loads(bytes(text))
        return Asked(given["environment"], given["folder"], (streams[0], streams[1], streams[2]))
    except (OSError, ValueError, KeyError, IndexError, struct.error) as error:
        log.info("somebody asked and did not say for what: %s", error)
        return None


def _is_ours(asker: socket.socket) -> bool:
    """Whether it is the same user who asks."""
    credentials = asker.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("3i"))
    return int(struct.unpack("3i", credentials)[1]) == os.getuid()


def _tell(asker: socket.socket, number: int) -> None:
    try:
        asker.sendall(NUMBER.pack(number))
    except OSError:  # it is gone, and its fork will be
        log.debug("nobody is there to be told %d", number)


def _close(asked: Asked) -> None:
    for stream in asked.streams:
        os.close(stream)


if __name__ == "__main__":
    main(sys.argv[1])
