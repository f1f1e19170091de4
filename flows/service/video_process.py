"""Starts the process of one video: a fork of the worker's template, which has imported everything, or a fresh one.

What a worker runs for each flow run, in place of `python -m prefect.engine`. To import Prefect and the stages takes
seconds of a processor, to fork a process that has done so hundredths. This process stands for its fork: a signal is
passed on, it ends as the fork ends, and the template ends the fork of one that was killed.
"""

import contextlib
import json
import os
import signal
import socket
import struct
import sys

TEMPLATE = "HUMANMM_TEMPLATE"
"""Environment variable: where the template of a worker listens, a name in Linux's abstract namespace of sockets."""
NUMBER = struct.Struct("i")
"""How the template tells a fork's process id, and later how it ended."""


def main() -> None:
    """Run the flow run that the environment names."""
    template = _template()
    fork = _ask(template) if template is not None else None
    if template is None or fork is None:
        os.execv(sys.executable, [sys.executable, "-m", "prefect.engine"])
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda number, _: _pass_on(fork, number))
    ended = _number(template)
    if ended is None:  # the template was killed, and its forks with it
        ended = int(signal.SIGKILL)
    code = os.waitstatus_to_exitcode(ended)
    if code < 0:
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), -code)
    os._exit(code)


def _template() -> socket.socket | None:
    """A connection to the template; None if the worker has none at the moment."""
    template = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        template.connect(f"\0{os.environ[TEMPLATE]}")
    except (KeyError, OSError):
        return None
    return template


def _ask(template: socket.socket) -> int | None:
    """Have the template fork; the fork's process id, or None if it would not."""
    asked = json.dumps({"environment": dict(os.environ), "folder": os.getcwd()}).encode()  # noqa: PTH109
    with contextlib.suppress(OSError):
        socket.send_fds(template, [NUMBER.pack(len(asked))], [0, 1, 2])
        template.sendall(asked)
        return _number(template)
    return None


def _number(template: socket.socket) -> int | None:
    with contextlib.suppress(OSError):
        told = template.recv(NUMBER.size, socket.MSG_WAITALL)
        return int(NUMBER.unpack(told)[0]) if len(told) == NUMBER.size else None
    return None


def _pass_on(fork: int, number: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.kill(fork, number)


if __name__ == "__main__":
    main()
