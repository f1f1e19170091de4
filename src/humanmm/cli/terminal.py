"""What verbs print: results on standard output, one plain line for everything else on standard error."""

import contextlib
import errno
import io
import json
import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, TextIO

from humanmm.logs import printable

_NOBODY_READS = (errno.EPIPE, errno.EIO)
"""The reader of a pipe has left; a terminal was closed."""


def open_standard_streams() -> None:
    """Give /dev/null to a standard stream that is closed: the next file that is opened would take its number."""
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(number)
        except OSError:
            os.dup2(os.open(os.devnull, os.O_RDWR), number)
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, mode, closefd=False))


def say_it_starts() -> None:
    """Say at once that a long command has begun: loading it may take seconds on a busy machine."""
    if sys.stderr.isatty() and os.environ.get("TERM") != "dumb":
        _first_line.append("humanmm: loading …")
        sys.stderr.write(_first_line[-1])
        sys.stderr.flush()


def take_back_start() -> None:
    """Clear what `say_it_starts` wrote: something else comes in its place."""
    if _first_line:
        _first_line.clear()
        with even_unread(sys.stderr):
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()


_first_line: list[str] = []


@contextlib.contextmanager
def even_unread(stream: TextIO) -> Iterator[None]:
    """Write to a stream that perhaps nobody reads any more: a command goes on, and ends with its own status."""
    try:
        yield
    except OSError as error:
        if error.errno not in _NOBODY_READS:
            raise
        with open(os.devnull, "wb") as nowhere:  # noqa: PTH123  # what is written later, and at the exit of Python
            os.dup2(nowhere.fileno(), stream.fileno())


def accept_all_characters() -> None:
    """Escape what a stream cannot encode: a file's name need not be text, a terminal need not know UTF-8."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def say(text: str) -> None:
    """One line on standard error."""
    take_back_start()
    with even_unread(sys.stderr):
        sys.stderr.write(f"humanmm: {printable(' '.join(text.split()))}\n")
        sys.stderr.flush()


def write(*lines: object) -> None:
    """Lines on standard output."""
    write_all(lines)


def write_all(lines: Iterable[object]) -> None:
    """Lines on standard output."""
    take_back_start()
    with even_unread(sys.stdout):
        text = "".join(f"{line}\n" for line in lines)
        sys.stdout.write(printable(text) if sys.stdout.isatty() else text)
        sys.stdout.flush()


def write_json(tree: Mapping[str, Any], *, indent: int | None = 1) -> None:
    """One JSON object on standard output."""
    write(json.dumps(tree, indent=indent, allow_nan=False))


def write_path(path: Path) -> None:
    """The path of a result, byte by byte for the next program: a file's name need not be text."""
    if sys.stdout.isatty():
        write(path)
        return
    take_back_start()
    with even_unread(sys.stdout):
        sys.stdout.flush()
        sys.stdout.buffer.write(os.fsencode(path) + b"\n")
        sys.stdout.buffer.flush()


def open_in_browser(page: Path) -> None:
    """Open a file in the user's browser, if he sits at a terminal of a machine with a screen; else do nothing."""
    has_screen = sys.platform == "darwin" or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
    if sys.stdout.isatty() and has_screen:
        import webbrowser

        webbrowser.open(page.absolute().as_uri())
