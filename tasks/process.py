"""Settings of the process in which stages run; none changes a result."""

import ctypes
import functools
import logging
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from typing import Any, TypeVar

log = logging.getLogger(__name__)
T = TypeVar("T")

_M_MMAP_THRESHOLD = -3
"""glibc's name for: the size from which a block of memory is mapped by itself and given back when freed."""
_PICTURE_BYTES = 1 << 20
_M_TRIM_THRESHOLD = -1
"""glibc's name for: how much free memory may lie at the end of a heap before it is given back."""
_SPARE_BYTES = 1 << 25
_LEAST_PRIORITY = 19
_PR_SET_PDEATHSIG = 1
_PR_SET_NAME = 15


def prepare_process() -> None:
    """Make this process fit for stages; call it before each of them, it costs nothing twice.

    Small tensors gain nothing from threads, stages run side by side, and sums come out the same. Pictures are given
    back to the system when freed: glibc otherwise learns to keep blocks of their size in its heap, where small results
    that outlive them take bites out of the holes, and memory grows with the video (1.2 GB instead of 0.35 GB for 200
    pictures of 1768 × 994). Smaller blocks are kept: to give back the end of the heap after each of a frame's arrays
    costs a page fault for every 4 KB of the next one, a quarter of the time of `points`.
    """
    for library in ("OMP", "OPENBLAS", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    _set_heap()
    if "torch" in sys.modules:
        sys.modules["torch"].set_num_threads(1)


@functools.cache
def _set_heap() -> None:
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is None or mallopt(_M_MMAP_THRESHOLD, _PICTURE_BYTES) != 1:
        log.debug("no mallopt here: memory may grow with the video")
    elif mallopt(_M_TRIM_THRESHOLD, _SPARE_BYTES) != 1:
        log.debug("the heap is trimmed at every turn: stages are slower")


def give_back_memory() -> None:
    """Give what was freed back to the system; what is asked for next is faulted in again, a microsecond for 4 KB."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


def in_spare_time(work: Callable[[], T]) -> T:
    """Do something in a thread of its own, and those that it starts, with the processor time that others leave.

    For work that nobody waits for yet beside work that everything waits for. A system that knows no priorities of
    threads does it at once.
    """
    with ThreadPoolExecutor(1, "spare", initializer=_yield_to_others) as thread:
        return thread.submit(work).result()


def _yield_to_others() -> None:
    if sys.platform == "linux":  # elsewhere the number of a thread is not that of a process
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _LEAST_PRIORITY)


def in_processes(work: Callable[..., T], calls: Sequence[tuple[Any, ...]], processes: int) -> Iterator[tuple[int, T]]:
    """`work(*call)` of all calls in fresh processes, so many at a time: (number of the call, answer) as they come.

    The processes end with this one, however it ends; an error of one call ends them all.
    """
    fresh, parent = multiprocessing.get_context("spawn"), os.getpid()
    with ProcessPoolExecutor(processes, mp_context=fresh, initializer=_begin_child, initargs=(parent,)) as pool:
        futures = {pool.submit(work, *call): number for number, call in enumerate(calls)}
        try:
            for future in as_completed(futures):
                yield futures[future], future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _begin_child(parent: int) -> None:
    end_with_parent(parent)
    prepare_process()


def end_with_parent(parent: int) -> None:
    """Have the kernel kill this process when its parent, that of this number, ends. On Linux only: elsewhere it goes
    on until it notices."""
    if sys.platform != "linux":
        return
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def name_process(name: str) -> None:
    """Name this process for `ps` and `top`: at most 15 characters. On Linux only."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_NAME, name.encode())


def treat_as_sigterm() -> None:
    """Have SIGHUP, SIGQUIT and SIGUSR1 end this process as SIGTERM does, which flows note, unless they are ignored."""
    if threading.current_thread() is not threading.main_thread():
        return  # only that one may set handlers
    for number in (signal.SIGHUP, signal.SIGQUIT, signal.SIGUSR1):
        if signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, lambda *_: os.kill(os.getpid(), signal.SIGTERM))
