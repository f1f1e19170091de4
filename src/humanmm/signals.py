"""The signals that ask a process to stop. It loads no library: the command line needs it before any is loaded."""

import contextlib
import signal
import threading
from collections.abc import Iterator

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGUSR1)
"""Ctrl-C; what stops a service; a terminal that is closed; Ctrl-\\; a batch system's warning that the time is up."""


@contextlib.contextmanager
def held() -> Iterator[None]:
    """Let what interrupts this thread come at the end of the block, where a library inside would lose it.

    Prefect logs each task that it submits; Ctrl-C becomes pydantic's own error there, and that a line in the log.
    """
    came: list[int] = []
    handlers = {number: handler for number in STOP_SIGNALS if callable(handler := signal.getsignal(number))}
    if threading.current_thread() is not threading.main_thread():
        handlers = {}  # only that one may set handlers, and is interrupted
    for number in handlers:
        signal.signal(number, lambda number, frame: came.append(number))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        if came:
            signal.raise_signal(came[0])
