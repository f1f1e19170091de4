"""The command line: `verb.py` declares a verb, each other file holds the verbs of one subject."""

import atexit
import contextlib
import importlib
import os
import signal
import sys
import threading
from collections.abc import Sequence

from humanmm.errors import interruption

SUBJECTS = (
    "recover",
    "camera",
    "correct",
    "results",
    "inspect",
    "batch",
    "serve",
    "bench",
    "dataset",
    "train",
    "maintain",
    "doctor",
)
"""Files of verbs, in the order of `humanmm --help`."""
INTERRUPTED = 130
"""Exit status of a process that SIGINT has ended, as shells count it."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns its exit status."""
    if arguments is None:
        atexit.register(_end_interrupted)  # the first to be registered is the last to run
    try:
        status = _run(arguments)
    except BaseException as error:  # before a verb has begun: nothing is computed yet
        if interruption(error) is None:
            raise
        sys.stderr.write("\rhumanmm: interrupted; resumable with the same command\n")
        status = INTERRUPTED
    if status == INTERRUPTED and arguments is None:  # this process ends: pressed again, Ctrl-C changes nothing
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        _ended_by.append(status)
        if any(not thread.daemon for thread in threading.enumerate() if thread is not threading.main_thread()):
            _end_interrupted()  # they still compute and cannot be stopped: Python would wait for them
    return status


_ended_by: list[int] = []
"""The status of a command that was interrupted."""


def _end_interrupted() -> None:
    """Leave with the status of an interrupted command.

    Python kills itself by SIGINT at its end if a KeyboardInterrupt ever went through `exec` of a text, as the standard
    library's dataclasses use it: whoever presses Ctrl-C while libraries are imported would see a killed process.
    """
    if _ended_by:
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError, ValueError):
                stream.flush()
        os._exit(_ended_by[0])


def _run(arguments: Sequence[str] | None) -> int:
    for library in ("OMP", "OPENBLAS", "MKL"):  # small tensors, stages side by side: one thread each; before numpy
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    from humanmm.cli.terminal import accept_all_characters, open_standard_streams, say, say_it_starts

    open_standard_streams()  # before a file is opened
    words = sys.argv[1:] if arguments is None else arguments
    if "recover" in words[:1] and not {"-h", "--help"} & set(words):
        say_it_starts()
    import typer

    from humanmm.cli.verb import app

    accept_all_characters()
    for subject in SUBJECTS:
        importlib.import_module(f"humanmm.cli.{subject}")
    try:
        return typer.main.get_command(app).main(arguments, prog_name="humanmm", standalone_mode=False) or 0
    except typer.TyperException as error:  # what the user typed names no verb, lacks a value, …
        from humanmm.cli.mistakes import usage_message

        say(usage_message(error, "humanmm"))
        return error.exit_code
