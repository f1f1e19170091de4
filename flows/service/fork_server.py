"""The process of a video is a fork of one process that has imported Prefect and all stages.

That process is the fork server of Python's `multiprocessing`, with `preload` loaded. Only the worker can connect to it:
its socket lies in a folder of mode 0700. To import everything takes seconds of processor time, to fork a process that
has done so hundredths, and loaded code is in memory once. A fork whose code was changed on the disk since it was loaded
ends before it runs anything; its video gets a fresh process, and later videos are forks of a new fork server.

On Linux only. The system libraries of macOS must not be used after a fork (Python's documentation, "Contexts and start
methods" of `multiprocessing`): there every video gets a fresh process.
"""

import contextlib
import gc
import logging
import multiprocessing
import os
import runpy
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from multiprocessing import forkserver
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from humanmm.flows.server.local_server import hold_port_of_server
from humanmm.flows.service.video_processes import VIDEO, begin_video
from humanmm.machine import num_threads
from humanmm.tasks.units.process import end_with_parent, prepare_process, treat_as_sigterm

log = logging.getLogger(__name__)

PRELOAD = "humanmm.flows.service.preload"
_FORK, _FRESH = multiprocessing.get_context("forkserver"), multiprocessing.get_context("spawn")

Environment = Mapping[str, str | None]
"""What differs from the environment of the worker, and so of its fork server; None: not set."""


# ---- in the worker


def launch() -> None:
    """Start the fork server, unless it runs; it imports while this process goes on."""
    if sys.platform != "linux":
        return
    _FORK.set_forkserver_preload([PRELOAD])
    forkserver.ensure_running()


def start(environment: Environment, folder: Path, run: Callable[[], None] | None = None) -> BaseProcess:
    """Start a process that runs a flow run: a fork, or a fresh process where a fork would not equal one.

    `run` takes the place of Prefect's engine. Not to be called by two threads at once.
    """
    if sys.platform == "linux":
        fork = _start_fork(environment, folder, run)
        if fork is not None:
            return fork
        _retire()
        launch()
    fresh = _FRESH.Process(target=_begin, args=(environment, folder, run, None), name=VIDEO)
    fresh.start()
    return fresh


def _start_fork(environment: Environment, folder: Path, run: Callable[[], None] | None) -> BaseProcess | None:
    """A fork that runs it; None where a fork would not equal a fresh process, or the fork server was killed."""
    answer, sender = _FORK.Pipe(duplex=False)
    with contextlib.suppress(OSError, EOFError):  # the fork server was killed
        fork = _FORK.Process(target=_begin, args=(environment, folder, run, sender), name=VIDEO)
        fork.start()
        sender.close()
        if answer.recv():
            return fork
        fork.join()
    return None


def _retire() -> None:
    """Have the fork server fork no more; it ends after its forks."""
    server: Any = forkserver._forkserver  # Python has no public way to do this
    with server._lock:
        pid, server._forkserver_pid = server._forkserver_pid, None
    if pid is not None:
        forks = multiprocessing.active_children()
        threading.Thread(target=_end, args=(pid, server._forkserver_alive_fd, forks), daemon=True).start()


def _end(pid: int, alive: int, forks: Sequence[BaseProcess]) -> None:
    """End a fork server when it has passed on how its forks ended."""
    for fork in forks:
        wait([fork.sentinel])
    os.close(alive)
    os.waitpid(pid, 0)


# ---- in the fork server


class Preloaded:
    """What the fork server has imported, and whether its forks still equal a fresh process."""

    def __init__(self) -> None:
        began_ns = time.time_ns()
        self.pid = os.getpid()
        _import_everything()
        modules = list(sys.modules.values())
        self._files = versions(path for module in modules if isinstance(path := getattr(module, "__file__", None), str))
        self._is_mixed = any(changed_ns >= began_ns for changed_ns, _ in self._files.values())
        hold_port_of_server()
        signal.signal(signal.SIGTERM, signal.SIG_IGN)  # what stops a worker's session is meant for the videos
        gc.collect()
        gc.freeze()  # the collector would write to every page that the forks share

    def is_fit(self) -> bool:
        """Whether the code on the disk is the loaded code, and the fork server has no thread that a fork would lack."""
        if self._is_mixed or versions(self._files) != self._files:
            log.info("code that the fork server has loaded was changed on the disk")
            return False
        if num_threads(self.pid) > 1:
            log.warning("a library has started a thread in the fork server: videos start in fresh processes")
            return False
        return True


def _import_everything() -> None:
    """All that a video of a batch needs, so that its process imports nothing more."""
    prepare_process()
    import prefect.flow_engine  # noqa: F401

    import humanmm.flows.batch
    import humanmm.storage.run_folder.motion_zarr
    import humanmm.tasks.pictures  # noqa: F401
    from humanmm.tasks import pipeline
    from humanmm.tasks.units.imports import Imports

    Imports(pipeline.STAGES).prepare(pipeline.STAGES[0])
    prepare_process()


def versions(paths: Iterable[str]) -> Mapping[str, tuple[int, int]]:
    """Modification time (ns since 1970) and size (bytes) of files; zeros for one that is not there."""
    found = dict.fromkeys(paths, (0, 0))
    for path in found:
        with contextlib.suppress(OSError):
            status = os.stat(path)  # noqa: PTH116
            found[path] = (status.st_mtime_ns, status.st_size)
    return found


# ---- in the process of a video


def _begin(environment: Environment, folder: Path, run: Callable[[], None] | None, answer: Connection | None) -> None:
    """Run the flow run that the environment names. A fork first sends whether it is fit, and ends if it is not.

    Before that it takes its name and no longer ignores SIGTERM, as its fork server does: a worker that is ending sends
    one as soon as it knows the process, and then waits for its end.
    """
    begin_video()
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    treat_as_sigterm()
    if answer is not None:
        preloaded = getattr(sys.modules.get(PRELOAD), "PRELOADED", None)  # None: the imports failed
        is_fit = isinstance(preloaded, Preloaded) and preloaded.is_fit()
        if isinstance(preloaded, Preloaded):
            end_with_parent(preloaded.pid)
        answer.send(is_fit)
        answer.close()
        if not is_fit:
            return
    for name, value in environment.items():
        os.environ.pop(name, None)
        if value is not None:
            os.environ[name] = value
    os.chdir(folder)
    sys.argv = ["prefect.engine"]
    (run or _run_engine)()


def _run_engine() -> None:
    import prefect.context

    prefect.context.refresh_global_settings_context()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # the module was imported before
        runpy.run_module("prefect.engine", run_name="__main__")
