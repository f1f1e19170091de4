"""Progress on a terminal, one line per stage that is at work; silent anywhere else."""

import sys
import threading
from types import TracebackType
from typing import Any

from humanmm.tasks.engine.units import Work


class Display:
    """Shows what the stages report. Cheap to call from many threads."""

    def __init__(self) -> None:
        self._bars: Any = None
        self._tasks: dict[str, Any] = {}
        self._lock = threading.Lock()

    def __enter__(self) -> "Display":
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

            columns = (TextColumn("{task.description:<20}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"))
            self._bars = Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True), transient=True)
            self._bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bars is not None:
            self._bars.stop()

    def progress(self, work: Work, done: int, total: int) -> None:
        """A stage has done so much of its work."""
        if self._bars is None:
            return
        with self._lock:
            if work.label not in self._tasks:
                self._tasks[work.label] = self._bars.add_task(work.label, total=total)
            self._bars.update(self._tasks[work.label], completed=done, total=total, visible=done < total)
