"""The messages between the flow's process and a process that computes one unit: a job there, its result back.

Nothing large travels: settings, references to artifacts in the store, log records, progress, and at the end the
manifest of the artifact that the other process has left in the store.
"""

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from humanmm.config import Config
from humanmm.storage.store.artifact import Ref
from humanmm.storage.store.identity import VideoIdentity
from humanmm.storage.store.store import Store
from humanmm.tasks.pipeline import Stage
from humanmm.tasks.units.execute import Result, UnitExecutor
from humanmm.tasks.units.faults import portable
from humanmm.tasks.units.selection import Selection
from humanmm.tasks.units.unit import UnitId

log = logging.getLogger(__name__)
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Setting:
    """The video, the configuration and the store that another process works with."""

    video: VideoIdentity
    config: Config
    store: Store
    selection: Selection
    stages: tuple[Stage, ...]

    def open(self) -> UnitExecutor:
        """What computes units in that process."""
        return UnitExecutor(self.video, self.config, self.store, selection=self.selection, stages=self.stages)


@dataclass(frozen=True)
class Job:
    """One unit to compute."""

    stage: str
    index: int
    references: Mapping[UnitId, Ref | None]
    """The artifacts that it reads and those that define units; None for a unit that failed."""


Message = tuple[int, int] | logging.LogRecord | Result | Exception
"""What comes back: progress and log records, then one result or error."""


def respond(executor: UnitExecutor, job: Job) -> Result | Exception:
    """Compute a job in this process; an error is returned in a form that travels."""
    label = job.stage
    try:
        executor.adopt(job.references)
        unit = executor.unit(job.stage, job.index)
        label = unit.label
        return executor.compute(unit)
    except Exception as error:  # sent to the other process, which raises it: this is the edge of this one
        log.debug("where it happened", exc_info=error)
        return portable(error, label)


def receive(message: tuple[int, int] | logging.LogRecord, progress: Progress) -> None:
    """Handle a message that comes before the result."""
    if isinstance(message, logging.LogRecord):
        logging.getLogger(message.name).handle(message)
    else:
        progress(*message)


class LogSender(logging.Handler):
    """Sends log records with their final text: the arguments of a record may not travel."""

    def __init__(self, send: Callable[[logging.LogRecord], None]) -> None:
        super().__init__()
        self._send = send

    def emit(self, record: logging.LogRecord) -> None:
        sent = logging.makeLogRecord(record.__dict__)
        sent.msg, sent.args = record.getMessage(), ()
        if record.exc_info:
            sent.exc_text = logging.Formatter().formatException(record.exc_info)
            sent.exc_info = None
        self._send(sent)
