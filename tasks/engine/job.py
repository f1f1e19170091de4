"""One stage × unit as another process is given it, and what that process answers.

Nothing large travels: settings, references to artifacts in the store, log lines, how far the stage is, and at the end
the manifest of what it has left in the store.
"""

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from humanmm.config import Config
from humanmm.storage.store.artifact import Manifest
from humanmm.storage.store.identity import VideoIdentity
from humanmm.storage.store.refs import Ref
from humanmm.storage.store.store import Store
from humanmm.tasks.engine.faults import portable
from humanmm.tasks.engine.selection import Selection
from humanmm.tasks.pipeline import Stage

if TYPE_CHECKING:
    from humanmm.tasks.engine.run import VideoRun

log = logging.getLogger(__name__)
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Setting:
    """The video that another process works on."""

    video: VideoIdentity
    config: Config
    store: Store
    selection: Selection
    stages: tuple[Stage, ...]

    def open(self) -> "VideoRun":
        """The run as that process has it."""
        from humanmm.tasks.engine.run import VideoRun

        return VideoRun(self.video, self.config, self.store, selection=self.selection, stages=self.stages)


@dataclass(frozen=True)
class Job:
    """One stage × unit."""

    stage: str
    index: int
    known: Mapping[tuple[str, int], Ref | None]
    """The units that it reads and those that list units; None where one has failed."""


@dataclass(frozen=True)
class Done:
    """What became of a job."""

    state: Literal["cached", "computed", "failed", "skipped"]
    manifest: Manifest
    reason: str
    changed: bool


Message = tuple[int, int] | logging.LogRecord | Done | Exception
"""What comes back: how far it is and log records, then one answer."""


def answer(run: "VideoRun", job: Job) -> Done | Exception:
    """Do a job in this process; an error is told in a form that travels."""
    label = job.stage
    try:
        run.know(job.known)
        work = run.work(job.stage, job.index)
        label = work.label
        outcome = run.compute_here(work)
        assert outcome.manifest is not None
        return Done(outcome.state, outcome.manifest, outcome.reason, outcome.changed)
    except Exception as error:  # told to the other process, which raises it: this is the edge of this one
        log.debug("where it happened", exc_info=error)
        return portable(error, label)


def hear(message: tuple[int, int] | logging.LogRecord, progress: Progress) -> None:
    """Take note of what comes before the answer."""
    if isinstance(message, logging.LogRecord):
        logging.getLogger(message.name).handle(message)
    else:
        progress(*message)


class LogSender(logging.Handler):
    """Passes log records on, with their text in place of what it is made of."""

    def __init__(self, send: Callable[[logging.LogRecord], None]) -> None:
        super().__init__()
        self._send = send

    def emit(self, record: logging.LogRecord) -> None:
        shown = logging.makeLogRecord(record.__dict__)
        shown.msg, shown.args = record.getMessage(), ()
        if record.exc_info:
            shown.exc_text = logging.Formatter().formatException(record.exc_info)
            shown.exc_info = None
        self._send(shown)
