"""Threads that take only the processor time that others leave. The priority changes no result."""

import os
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

T = TypeVar("T")
LOWEST_PRIORITY = 19
"""The largest `nice` value."""


def at_low_priority(function: Callable[[], T]) -> T:
    """Call a function in a thread of the lowest priority, which the threads that it starts inherit.

    For a stage that nothing waits for, beside one that everything waits for. Only Linux gives each thread a priority;
    elsewhere the thread keeps that of its process.
    """
    with ThreadPoolExecutor(1, "low-priority", initializer=_lower_priority) as thread:
        return thread.submit(function).result()


def _lower_priority() -> None:
    if sys.platform == "linux":  # elsewhere the number of a thread is not that of a process
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), LOWEST_PRIORITY)
