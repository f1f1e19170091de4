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


def in_bytes(count: float) -> str:
    """A size as people read it."""
    for unit in ("B", "kB", "MB"):
        if count < 1000:
            return f"{count:.0f} {unit}"
        count /= 1000
    return f"{count:.1f} GB"
