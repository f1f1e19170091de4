"""Log lines for people, or one JSON object a line for machines ($HUMANMM_LOG=json).

The second holds in every process that a run starts: the command, workers, the flow run of each video.
"""

import contextlib
import io
import json
import logging
import os
import sys
import time
from collections.abc import Iterator
from typing import TextIO

VARIABLE = "HUMANMM_LOG"
_OWN = frozenset(vars(logging.makeLogRecord({}))) | {"message", "asctime", "taskName"}


class JsonLines(logging.Formatter):
    """One object a line: time, level, logger, message, what the caller gave as `extra`, where an error was."""

    def format(self, record: logging.LogRecord) -> str:
        moment = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(record.created))
        entry: dict[str, object] = {
            "time": f"{moment}.{int(record.msecs):03d}Z",
            "level": record.levelname,
            "logger": record.name,
            "message": record.getMessage(),
            "process": record.process,
        }
        entry |= {name: value for name, value in vars(record).items() if name not in _OWN}
        if record.exc_info:
            entry["error"] = self.formatException(record.exc_info)
        return json.dumps(entry, default=str)


def printable(text: str) -> str:
    """A text without what a terminal obeys, such as colours and titles in the name of a file: written as escapes."""
    return "".join(one if one.isprintable() or one in "\n\t" else ascii(one)[1:-1] for one in text)


class _Printable(logging.Formatter):
    """Lines for a terminal."""

    def format(self, record: logging.LogRecord) -> str:
        return printable(super().format(record))


class _StandardError(logging.StreamHandler[TextIO]):
    """Writes to sys.stderr as it is now: while a run is shown on a terminal, lines go above what is shown."""

    def emit(self, record: logging.LogRecord) -> None:
        self.stream = sys.stderr  # setStream would flush the one before, which may be closed
        super().emit(record)


def wants_json() -> bool:
    """Whether log lines are for machines."""
    return os.environ.get(VARIABLE) == "json"


def to_standard_error(*, verbose: bool) -> None:
    """Write our log to standard error: warnings, or everything if `verbose` or for machines."""
    handler = _StandardError(sys.stderr)
    if wants_json():
        handler.setFormatter(JsonLines())
    else:
        handler.setFormatter(_Printable("%(levelname)s %(name)s: %(message)s" if verbose else "humanmm: %(message)s"))
    handler.setLevel(logging.DEBUG if verbose else logging.INFO if wants_json() else logging.WARNING)
    logger = logging.getLogger("humanmm")
    logger.handlers = [handler]
    logger.setLevel(logging.INFO)
    logger.propagate = False


@contextlib.contextmanager
def keeping_text() -> Iterator[io.StringIO]:
    """Keep our log while the context lasts, for the run.log of the video that is computed meanwhile."""
    logger = logging.getLogger("humanmm")
    text, level = io.StringIO(), logger.level
    handler = logging.StreamHandler(text)
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(name)s: %(message)s"))
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    try:
        yield text
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)
