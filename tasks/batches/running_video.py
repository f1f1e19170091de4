"""One video of a batch while it is computed: its process owns the row of the batch table and keeps it up to date."""

import contextlib
import logging
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from humanmm.errors import NoUsablePersonError, StoreError, VideoError
from humanmm.storage.batches.batch_table import BatchTable
from humanmm.storage.batches.owner import RENEW_S
from humanmm.storage.batches.video_row import VideoRow, facts_of, may_be_same
from humanmm.tasks.engine import finish
from humanmm.tasks.engine.run import VideoRun
from humanmm.tasks.units.faults import in_words, is_infrastructure_fault

log = logging.getLogger(__name__)
T = TypeVar("T")
LOOK_EVERY_S = 1.0
WAITS_S = (1.0, 4.0, 15.0, 30.0)
"""Between retries of a write: a disk that is full for half a minute costs a video no attempt."""
REPLACED = "the file was replaced after it was submitted"


class RunningVideo:
    """The row of one video that this process computes."""

    def __init__(self, table: BatchTable, row: VideoRow) -> None:
        self.table, self.row = table, row
        self.run: VideoRun | None = None
        """Set by the flow when the video is open."""
        self.flow_run: str | None = None
        """Prefect's id of the flow run that computes it."""
        self._facts = row.facts
        """Of the file as it is when the video begins."""
        self._over = threading.Event()
        self._stage: str | None = None

    @contextlib.contextmanager
    def owned(self, flow_run: str | None) -> Iterator[bool]:
        """Own the video and report its stage while the body runs; False if it is not to be computed here."""
        self.flow_run = flow_run
        begun = time.time()
        self._facts = facts_of(Path(self.row.video)) or self.row.facts
        if self._is_replaced:
            log.warning("%s: %s", self.row.video, REPLACED)
        if not retried(lambda: self.table.claim(self.row, flow_run=flow_run)):
            yield False
            return
        reporter = threading.Thread(target=self._report, args=(begun,), daemon=True)
        reporter.start()
        try:
            yield True
        finally:
            self._over.set()
            reporter.join()
            retried(lambda: self.table.release(self.row, seconds=_since(begun)))

    def end(self, state: str, reason: str, error: Exception | None = None) -> None:
        """Record how it ended, of which file, and of which error, unless somebody has cancelled it meanwhile."""
        values: dict[str, Any] = {
            "state": state,
            "reason": "; ".join(filter(None, (reason, REPLACED if self._is_replaced else ""))),
            "stage": self._failed_stage(error) if state in ("failed", "partial") else None,
            "facts": self._facts,
            # one that could not be opened may have been away, or locked, for a while
            "hopeless": self.run is not None and isinstance(error, VideoError | NoUsablePersonError),
        }
        retried(lambda: self.table.change(self.row, only_from=("running",), **values))

    def fail(self, error: Exception) -> None:
        """Record the error that ended it; after a fault of the disk, the store or the machine it is scheduled again."""
        if is_infrastructure_fault(error):
            self._lose("failed", in_words(error), error)
        else:
            self.end("failed", in_words(error), error)

    def end_partial(self, reason: str) -> None:
        """Record that shots are missing; if nothing but such faults took them, it is scheduled again."""
        lost = finish.failures(self.run) if self.run else []
        if lost and all(is_infrastructure_fault(outcome.error or Exception()) for outcome in lost):
            self._lose("partial", reason)
        else:
            self.end("partial", reason)

    def resume_later(self, reason: str) -> None:
        """Have it wait for another attempt: its process received SIGTERM."""
        retried(lambda: self.table.try_again(self.row, reason))

    @property
    def _is_replaced(self) -> bool:
        """Whether it was another file when it was submitted."""
        return bool(self.row.facts) and not may_be_same(self.row.facts, self._facts)

    def _lose(self, state: str, reason: str, error: Exception | None = None) -> None:
        retried(lambda: self.table.lose(self.row, reason, state=state, stage=self._failed_stage(error)))

    def _report(self, begun: float) -> None:
        renewed = time.monotonic()
        while not self._over.wait(LOOK_EVERY_S):
            try:
                self._write_progress(begun)
                if time.monotonic() - renewed > RENEW_S:
                    renewed = time.monotonic()
                    if not self.table.renew(self.row):
                        log.warning("%s was cancelled or taken over; this process ends", self.row.video)
                        os.kill(os.getpid(), signal.SIGTERM)
                        return
            except StoreError as error:  # tried again a second later
                log.info("the batch table could not be written: %s", error)

    def _write_progress(self, begun: float) -> None:
        if self.row.losses and self._has_computed():
            self.row = replace(self.row, losses=0)
            self.table.change(self.row, losses=0)
        stage = self._current_stage()
        if stage != self._stage:
            self._stage = stage
            self.table.change(self.row, only_from=("running",), stage=stage, seconds=_since(begun))

    def _has_computed(self) -> bool:
        """Whether there is something now that there was not before this attempt."""
        return any(o.state == "computed" for o in list(self.run.outcomes.values())) if self.run else False

    def _current_stage(self) -> str | None:
        outcomes = list(self.run.outcomes.values()) if self.run else []
        at_work = [o.unit.label for o in outcomes if o.began and o.manifest is None and o.error is None]
        return at_work[0] if at_work else self._stage

    def _failed_stage(self, error: Exception | None = None) -> str | None:
        """The unit that raised an error, else the first that failed, else the one that is at work."""
        failed = finish.failures(self.run) if self.run else []
        labels = [outcome.unit.label for outcome in failed if error is None or outcome.error is error]
        return next(iter(labels), failed[0].unit.label if failed else self._stage)


def retried(operation: Callable[[], T]) -> T:
    """What an operation on the batch table returns; retried for a minute if that cannot be read or written."""
    for wait_s in WAITS_S:
        try:
            return operation()
        except StoreError as error:
            log.warning("%s; retried in %g s", error, wait_s)
            time.sleep(wait_s)
    return operation()


def _since(begun: float) -> float:
    return round(time.time() - begun, 3)
