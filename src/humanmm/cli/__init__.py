"""The command line: `verb.py` declares a verb, each other file holds the verbs of one subject."""

import importlib
import os
import signal
import sys
from collections.abc import Sequence

SUBJECTS = (
    "recover",
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
    try:
        status = _run(arguments)
    except KeyboardInterrupt:  # before a verb has begun: nothing is computed yet
        sys.stderr.write("\rhumanmm: interrupted; resumable with the same command\n")
        status = INTERRUPTED
    if status == INTERRUPTED and arguments is None:  # this process ends: pressed again, Ctrl-C changes nothing
        signal.signal(signal.SIGINT, signal.SIG_IGN)
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
