"""What verbs print: results on standard output, one plain line for everything else on standard error."""

import io
import json
import os
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any


def accept_all_characters() -> None:
    """Escape what a stream cannot encode: a file's name need not be text, a terminal need not know UTF-8."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def say(text: str) -> None:
    """One line on standard error."""
    sys.stderr.write(f"humanmm: {' '.join(text.split())}\n")


def write(*lines: object) -> None:
    """Lines on standard output."""
    write_all(lines)


def write_all(lines: Iterable[object]) -> None:
    """Lines on standard output."""
    sys.stdout.write("".join(f"{line}\n" for line in lines))
    sys.stdout.flush()


def write_json(tree: Mapping[str, Any], *, indent: int | None = 1) -> None:
    """One JSON object on standard output."""
    sys.stdout.write(json.dumps(tree, indent=indent, allow_nan=False) + "\n")


def write_path(path: Path) -> None:
    """The path of a result, byte by byte: a file's name need not be text."""
    sys.stdout.flush()
    sys.stdout.buffer.write(os.fsencode(path) + b"\n")
    sys.stdout.buffer.flush()


def open_in_browser(page: Path) -> None:
    """Open a file in the user's browser, if he sits at a terminal of a machine with a screen; else do nothing."""
    has_screen = sys.platform == "darwin" or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
    if sys.stdout.isatty() and has_screen:
        import webbrowser

        webbrowser.open(page.absolute().as_uri())


def in_bytes(count: float) -> str:
    """A size as people read it."""
    for unit in ("B", "kB", "MB"):
        if count < 1000:
            return f"{count:.0f} {unit}"
        count /= 1000
    return f"{count:.1f} GB"
