"""The threads and the memory that the stages of one video share."""

import contextlib
import threading
from collections.abc import Iterator

from humanmm.config import RunConfig
from humanmm.tasks.pipeline import Resources, Stage

THREAD_MB = 640
"""Memory for each stage that may run at the same time: two that read 1080p, and at 8192 x 8192 one alone."""


def resources_of(stage: Stage, settings: RunConfig, *, megapixels: float = 0.0, num_frames: int = 0) -> Resources:
    """What one unit of a stage may use, by the size of the picture and its frames: the table's figures, with the user's
    where given."""
    own = settings.stages.get(stage.name)
    given = own.model_dump(exclude_none=True) if own is not None else {}
    if settings.limit_s is not None:
        given.setdefault("limit_s", settings.limit_s)
    return stage.resources.for_unit(megapixels, num_frames).with_values(given)


def budget_of(settings: RunConfig) -> "Budget":
    """The budget that the settings give. Without one for memory, stages that read large pictures run one at a time on
    this machine; workers elsewhere have memory of their own."""
    memory_mb = settings.memory_mb
    if memory_mb is None and settings.runner == "threads":
        memory_mb = THREAD_MB * settings.threads
    return Budget(threads=settings.threads, memory_mb=memory_mb)


class Budget:
    """Lets a stage begin when the resources that it needs are free; one that needs more than the whole runs alone."""

    def __init__(self, *, threads: int, memory_mb: int | None) -> None:
        self._all = (threads, memory_mb if memory_mb is not None else 1 << 40)
        self._free = self._all
        self._changed = threading.Condition()

    @contextlib.contextmanager
    def taken(self, needed: Resources, *, alone: bool = False) -> Iterator[None]:
        """Reserve a part while a stage computes; the whole if it is to run `alone`."""
        most = (needed.threads, needed.memory_mb)
        part = self._all if alone else (min(most[0], self._all[0]), min(most[1], self._all[1]))
        with self._changed:
            self._changed.wait_for(lambda: self._free[0] >= part[0] and self._free[1] >= part[1])
            self._free = (self._free[0] - part[0], self._free[1] - part[1])
        try:
            yield
        finally:
            with self._changed:
                self._free = (self._free[0] + part[0], self._free[1] + part[1])
                self._changed.notify_all()
