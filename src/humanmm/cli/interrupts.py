"""Ctrl-C and the signals that stop a command: noted, because libraries make other errors of them, or none.

A compiled module whose import is interrupted raises ImportError, pydantic's serialiser an error of its own; what is
raised while Python takes an object away is lost.
"""

import _thread
import contextlib
import math
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from types import FrameType

from humanmm.signals import STOP_SIGNALS

INTERRUPTED = 130
"""Exit status of a process that SIGINT has ended, as shells count it."""
AGAIN_S = 0.02
"""After so long an interruption that was lost comes again."""
TOGETHER_S = 1.0
"""Signals within so long of the one that interrupted are the same interruption: whoever presses Ctrl-C thrice wants one
end, and a second error, raised while the first one takes everything down, would leave threads to be waited for."""
_received: list[int] = []
"""Since the command began."""


@contextlib.contextmanager
def noted() -> Iterator[None]:
    """Have signals that would end the process without a word interrupt it as Ctrl-C does, and note them all."""
    raised_s = -math.inf

    def stop(number: int, frame: FrameType | None) -> None:
        nonlocal raised_s
        _received.append(number)
        if time.monotonic() - raised_s >= TOGETHER_S:
            raised_s = time.monotonic()
            raise KeyboardInterrupt(_words(number))

    def unraisable(lost: "sys.UnraisableHookArgs") -> None:
        nonlocal raised_s
        if isinstance(lost.exc_value, KeyboardInterrupt) and _received:
            raised_s = -math.inf
            again = threading.Timer(AGAIN_S, _thread.interrupt_main, [_received[-1]])  # raised here it is lost too
            again.daemon = True
            again.start()
        else:
            told(lost)

    _received.clear()
    pythons_own = (signal.SIG_DFL, signal.default_int_handler)
    before = {number: handler for number in STOP_SIGNALS if (handler := signal.getsignal(number)) in pythons_own}
    if threading.current_thread() is not threading.main_thread():
        before = {}  # only that one may set handlers
    for number in before:
        signal.signal(number, stop)
    told, sys.unraisablehook = sys.unraisablehook, unraisable
    try:
        yield
    finally:
        sys.unraisablehook = told
        for number, handler in before.items():
            if signal.getsignal(number) is stop:
                signal.signal(number, handler)


def interruption(error: BaseException) -> str | None:
    """What interrupted a command that ended with an error, in words; None where nothing did."""
    if isinstance(error, KeyboardInterrupt):
        return str(error) or _words(signal.SIGINT)
    return _words(_received[0]) if _received else None


def leave() -> None:
    """End the process at once, with the status of an interrupted command.

    Python kills itself by SIGINT at its end if a KeyboardInterrupt ever went through `exec` of a text, as the standard
    library's dataclasses use it: whoever presses Ctrl-C while libraries are imported would see a killed process.
    """
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    os._exit(INTERRUPTED)


def _words(number: int) -> str:
    return "interrupted" if number == signal.SIGINT else f"stopped by {signal.Signals(number).name}"
