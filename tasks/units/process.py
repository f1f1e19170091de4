"""The process in which stages run: its heap, its threads, its end. None of this changes a result."""

import ctypes
import functools
import logging
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from types import FrameType
from typing import Any, TypeVar

from threadpoolctl import threadpool_limits

log = logging.getLogger(__name__)
T = TypeVar("T")

_M_MMAP_THRESHOLD = -3
"""glibc's option: the size from which a block of memory is mapped by itself and unmapped when freed."""
_PICTURE_BYTES = 1 << 20
_M_TRIM_THRESHOLD = -1
"""glibc's option: how much free memory may lie at the end of the heap before it is trimmed."""
_SPARE_BYTES = 1 << 25
_M_ARENA_MAX = -8
"""glibc's option: how many heaps there may be."""
PARENT_S = 0.5
"""Seconds between two looks whether the parent of this process lives, on systems whose kernel does not tell."""
_PR_SET_PDEATHSIG = 1
_PR_SET_NAME = 15


def prepare_process() -> None:
    """Set the heap and the number of threads of this process for stages; a second call costs nothing.

    One thread a library: small tensors gain nothing from more, stages run side by side, and sums come out the same.
    Freed pictures go back to the system: glibc otherwise learns to keep blocks of their size in its heap, where small
    results that outlive them fragment it, and memory grows with the video (1.2 GB instead of 0.35 GB for 200 pictures
    of 1768 × 994). Smaller blocks stay in the heap: trimming it after each of a frame's arrays costs a page fault for
    every 4 KB of the next one, a quarter of the time of `points`.
    """
    for library in ("OMP", "OPENBLAS", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    if "numpy" in sys.modules:  # a program that calls humanmm has loaded it, and its libraries have read the above
        threadpool_limits(limits=1)
    _set_heap()
    if "torch" in sys.modules:
        sys.modules["torch"].set_num_threads(1)


@functools.cache
def _set_heap() -> None:
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is None or mallopt(_M_MMAP_THRESHOLD, _PICTURE_BYTES) != 1:
        log.debug("this C library has no mallopt: memory may grow with the video")
    elif mallopt(_M_TRIM_THRESHOLD, _SPARE_BYTES) != 1:
        log.debug("mallopt refused M_TRIM_THRESHOLD: the heap is trimmed often, and stages are slower")


def share_heaps(count: int) -> None:
    """Have all threads take memory from so many heaps, where glibc gives each thread its own, up to eight a core.

    To be called before there are threads. What is freed in one heap does not serve threads of another, so that a
    process with many threads that come and go grows for hours.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is None or mallopt(_M_ARENA_MAX, count) != 1:
        log.debug("this C library has no mallopt for heaps: memory may grow with the number of threads")


def release_memory() -> None:
    """Return freed memory to the system; the next allocations are faulted in again, a microsecond for 4 KB."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


def in_processes(
    function: Callable[..., T], calls: Sequence[tuple[Any, ...]], processes: int
) -> Iterator[tuple[int, T]]:
    """Yields (number of the call, result) of `function(*call)` as they finish, in this many fresh processes.

    The processes end with this one, however it ends; an error of one call ends them all.
    """
    fresh, parent = multiprocessing.get_context("spawn"), os.getpid()
    with ProcessPoolExecutor(processes, mp_context=fresh, initializer=_begin_child, initargs=(parent,)) as pool:
        futures = {pool.submit(function, *call): number for number, call in enumerate(calls)}
        try:
            for future in as_completed(futures):
                yield futures[future], future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def made_in_processes(function: Callable[..., T], calls: Sequence[tuple[Any, ...]], processes: int) -> Iterator[T]:
    """The results alone; in this process where there is one call or one process to make it in."""
    if processes == 1 or len(calls) == 1:
        yield from (function(*call) for call in calls)
        return
    for _, result in in_processes(function, calls, processes):
        yield result


def _begin_child(parent: int) -> None:
    end_with_parent(parent)
    prepare_process()


def end_with_parent(parent: int) -> None:
    """Have this process end at once when its parent, process number `parent`, does.

    The kernel of Linux kills it; elsewhere a thread looks every PARENT_S.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    else:
        threading.Thread(target=_end_after, args=(parent,), daemon=True).start()
    if os.getppid() != parent:
        os._exit(1)


def _end_after(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(PARENT_S)
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
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _pass_on)


def passed_on() -> signal.Signals | None:
    """The signal that came in place of the SIGTERM that ends this process, if one did."""
    return _passed_on[-1] if _passed_on else None


_passed_on: list[signal.Signals] = []


def _pass_on(number: int, frame: FrameType | None) -> None:
    _passed_on.append(signal.Signals(number))
    os.kill(os.getpid(), signal.SIGTERM)
