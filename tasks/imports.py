"""Importing the code of later stages while an earlier one is computed.

Decoders and networks leave Python's lock free, so that the second or two that imports take cost next to nothing then.
One thread imports at a time: Python gets libraries with circular imports wrong when two threads enter them from two
sides.
"""

import contextlib
from collections.abc import Callable, Sequence
from importlib import import_module
from threading import Event, RLock, Thread
from typing import Any, cast

from humanmm.tasks.pipeline import Stage

_IMPORTING = RLock()
_FOR_EVERY_STAGE = "zarr.codecs"
"""What writes the first artifact."""


class Imports:
    """The functions of some stages; once `begin` is called a thread imports them in their order."""

    def __init__(self, stages: Sequence[Stage]) -> None:
        self._stages = stages
        self._over = Event()
        self._thread: Thread | None = None

    def function(self, stage: Stage) -> Callable[[Any], Any]:
        """What computes a stage."""
        module, name = stage.function
        with _IMPORTING:
            return cast(Callable[[Any], Any], getattr(import_module(module), name))

    def begin(self, after: Stage) -> None:
        """Import what comes after this stage; nothing happens when it has begun before."""
        if self._thread is None and not self._over.is_set():
            self._thread = Thread(target=self._import, args=(after,), name="imports", daemon=True)
            self._thread.start()

    def end(self) -> None:
        """Import nothing more."""
        self._over.set()
        if self._thread is not None:
            self._thread.join()

    def _import(self, after: Stage) -> None:
        with _IMPORTING:
            import_module(_FOR_EVERY_STAGE)
        for stage in self._stages[self._stages.index(after) + 1 :]:
            if self._over.is_set():
                return
            with contextlib.suppress(Exception):  # the stage says it itself when its turn comes
                self.function(stage)
