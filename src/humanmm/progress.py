"""Progress bars, one for each stage at work: on a terminal and in a notebook, nothing anywhere else."""

import contextlib
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from rich.progress import TaskID

    from humanmm.tasks.units.unit import Unit


@contextmanager
def progress_bars(*, shown: bool = True) -> "Iterator[Callable[[Unit, int, int], None]]":
    """A function that shows the progress of stages: (unit, done, total). Many threads may call it."""
    if not shown or not (sys.stderr.isatty() or "ipykernel" in sys.modules):
        yield lambda unit, done, total: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description:<20}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"))
    bars = Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True), transient=True)
    rows: dict[str, TaskID] = {}
    lock = threading.Lock()

    def report(unit: "Unit", done: int, total: int) -> None:
        with lock, contextlib.suppress(OSError):  # the terminal may have been closed: the run goes on
            if unit.label not in rows:
                rows[unit.label] = bars.add_task(unit.label, total=total)
            bars.update(rows[unit.label], completed=done, total=total, visible=done < total)

    bars.start()
    try:
        yield report
    finally:
        with contextlib.suppress(OSError):
            bars.stop()
