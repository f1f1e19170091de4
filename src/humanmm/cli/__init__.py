"""The command line: `verb.py` declares a verb, each other file holds the verbs of one subject."""

import atexit
import importlib
import os
import signal
import sys
import threading
from collections.abc import Sequence

from humanmm.cli.interrupts import INTERRUPTED, interruption, leave, noted

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


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns its exit status."""
    ended: list[int] = []
    if arguments is None:
        atexit.register(lambda: leave() if INTERRUPTED in ended else None)  # the first to be registered runs last
    with noted():
        try:
            status = _run(arguments)
        except BaseException as error:  # before a verb has begun: nothing is computed yet
            stopped = interruption(error)
            if stopped is None:
                raise
            sys.stderr.write(f"\rhumanmm: {stopped}; resumable with the same command\n")
            status = INTERRUPTED
        ended.append(status)
        if status == INTERRUPTED and arguments is None:  # this process ends: pressed again, Ctrl-C changes nothing
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            if any(not thread.daemon for thread in threading.enumerate() if thread is not threading.main_thread()):
                leave()  # they still compute and cannot be stopped: Python would wait for them
    return status


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
