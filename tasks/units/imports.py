"""Imports the code of all stages still to come at once, before the first of them is computed.

Imports count in no stage's time. In a thread beside the first stages they cost twice as much, because decoding waits
for Python's lock, and Python gets libraries with circular imports wrong when two threads enter them from two sides.
"""

import contextlib
from collections.abc import Callable, Sequence
from importlib import import_module
from threading import RLock
from typing import Any, cast

from humanmm.tasks.pipeline import Stage

_IMPORTING = RLock()
_FOR_EVERY_STAGE = "zarr.codecs"
"""What writes the first artifact."""


class Imports:
    """The functions of some stages."""

    def __init__(self, stages: Sequence[Stage]) -> None:
        self._stages = stages
        self._prepared = False

    def function(self, stage: Stage) -> Callable[[Any], Any]:
        """The function that computes a stage."""
        module, name = stage.function
        with _IMPORTING:
            return cast(Callable[[Any], Any], getattr(import_module(module), name))

    def prepare(self, first: Stage) -> None:
        """Import the code of a stage and of all after it, once. A broken module fails when its stage runs."""
        with _IMPORTING:
            if self._prepared:
                return
            import_module(_FOR_EVERY_STAGE)
            for stage in self._stages[self._stages.index(first) :]:
                with contextlib.suppress(Exception):
                    self.function(stage)
            self._prepared = True
