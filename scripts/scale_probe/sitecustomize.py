"""What `scripts/measure_scale` has every process of `humanmm serve` load: stub stages, and an account of each video.

With SCALE_STUB=1 the table of stages is the one of `tests/toyline`, which computes next to nothing. A process that
computes a video appends a line to SCALE_LOG when it ends: its processor seconds, by what they went for.
"""

import functools
import json
import os
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

ZARR = "zarr_io"
"""zarr's own thread, and by inheritance those that it starts, do the same for all results whoever was first to ask."""
_SCIENCE = threading.local()
_LOCK = threading.Lock()
_SECONDS = dict.fromkeys(("start", "imports", "stages", "store", "folder"), 0.0)
_ENDED = {True: 0.0, False: 0.0}
"""Processor seconds of Python threads that have ended: of those that stages started, and of all others."""


def _counted(what: str, function: Callable[..., Any]) -> Callable[..., Any]:
    """The same function, its processor time in this thread added up under a name; no stage contains another."""

    @functools.wraps(function)
    def counting(*given: Any, **named: Any) -> Any:
        before, within = time.thread_time(), getattr(_SCIENCE, "now", False)
        _SCIENCE.now = within or what == "stages"
        try:
            return function(*given, **named)
        finally:
            _SCIENCE.now = within
            with _LOCK:
                _SECONDS[what] += time.thread_time() - before

    return counting


def _watch_threads() -> None:
    """Tell threads that a stage starts, and those in which zarr packs results, from those of Prefect and the engine."""
    start, run = threading.Thread.start, threading.Thread._bootstrap_inner  # type: ignore[attr-defined]

    def starting(self: Any) -> None:
        self.of_science = getattr(_SCIENCE, "now", False) or self.name.startswith(ZARR)
        start(self)

    def running(self: Any) -> None:
        _SCIENCE.now = self.of_science
        try:
            run(self)
        finally:
            with _LOCK:
                _ENDED[self.of_science] += time.thread_time()

    threading.Thread.start = starting  # type: ignore[method-assign]
    threading.Thread._bootstrap_inner = running  # type: ignore[attr-defined]


def _watch_video() -> None:
    from humanmm.storage.store import store
    from humanmm.tasks.engine import finish
    from humanmm.tasks.engine import run as engine
    from humanmm.tasks.units.imports import Imports

    function = Imports.function
    Imports.function = lambda self, stage: _counted("stages", function(self, stage))  # type: ignore[method-assign]
    Imports.prepare = _counted("imports", Imports.prepare)  # type: ignore[method-assign]
    store.Store.commit = _counted("store", store.Store.commit)  # type: ignore[method-assign]
    finish.write_results = _counted("folder", finish.write_results)
    opened = engine.VideoRun.__init__

    def opening(self: Any, *given: Any, **named: Any) -> None:
        _SECONDS["start"] = _SECONDS["start"] or time.process_time()
        opened(self, *given, **named)

    engine.VideoRun.__init__ = opening  # type: ignore[method-assign]
    _watch_threads()
    os.register_at_fork(after_in_child=_begin)
    threading._register_atexit(_write)  # type: ignore[attr-defined]  # forks of a fork server know no other end


def _begin() -> None:
    """A fork has spent nothing yet."""
    _SECONDS.update(dict.fromkeys(_SECONDS, 0.0))
    _ENDED.update(dict.fromkeys(_ENDED, 0.0))


def _write() -> None:
    if not _SECONDS["start"]:  # no video was opened here
        return
    alive = [thread for thread in threading.enumerate() if thread.ident and not getattr(thread, "of_science", False)]
    ours = sum(time.clock_gettime(time.pthread_getcpuclockid(thread.ident or 0)) for thread in alive) + _ENDED[False]
    spent = {name: _SECONDS[name] for name in ("start", "imports", "store", "folder")}
    engine = ours - sum(_SECONDS.values())
    total = time.process_time()
    line = {**spent, "engine": engine, "science": total - engine - sum(spent.values()), "total": total}
    with open(os.environ["SCALE_LOG"], "a", encoding="utf-8") as file:  # noqa: PTH123
        file.write(json.dumps(line) + "\n")


if os.environ.get("SCALE_STUB") == "1":
    from toyline.table import STAGES

    from humanmm.tasks import pipeline

    pipeline.STAGES = STAGES
VIDEOS = ("humanmm.flows.service.preload", "multiprocessing.spawn")
if "SCALE_LOG" in os.environ and any(name in part for part in sys.orig_argv for name in VIDEOS):
    _watch_video()
