"""How much main memory each stage takes: every unit in a fresh process, one after the other.

What counts is how far the resident memory of that process grows above what it has with the code of all stages loaded,
at its highest: decoded inputs, pictures, the networks it loads, and the result while it is written.
"""

import contextlib
import multiprocessing
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from humanmm.config import Config
from humanmm.storage.store.identity import identify
from humanmm.storage.store.refs import Ref
from humanmm.storage.store.store import Store
from humanmm.tasks.engine.job import Job, Setting
from humanmm.tasks.engine.run import VideoRun
from humanmm.tasks.engine.selection import Selection
from humanmm.tasks.process import prepare_process


@dataclass(frozen=True)
class UnitMemory:
    """What one stage × unit took."""

    stage: str
    unit: str
    before_mb: float
    """Of a process that has the code of all stages loaded."""
    grown_mb: float
    """Above that, at most."""


def measure_memory(video: Path, config: Config, store: Store) -> Iterator[UnitMemory]:
    """Compute every stage × unit of a video, whatever the store has of it, and tell what each took."""
    selection = Selection(force=True)
    run = VideoRun(identify(video, store), config, store, selection=selection)
    setting = Setting(run.video, config, store, selection, run.stages)
    fresh = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=fresh, max_tasks_per_child=1) as process:
        for stage in run.stages:
            for work in run.works(stage) or ():
                job = Job(stage.name, work.index, run.known_for(work))
                before_mb, most_mb, ref = process.submit(_compute, setting, job).result()
                run.know({(stage.name, work.index): ref})
                yield UnitMemory(stage.name, work.unit, before_mb, most_mb - before_mb)


def _compute(setting: Setting, job: Job) -> tuple[float, float, Ref]:
    """Memory before and at most, MB, and what was computed."""
    prepare_process()
    run = setting.open()
    run.imports.prepare(run.stages[0])
    run.know(job.known)
    with contextlib.suppress(OSError):  # else the most counts from the start of the process
        Path("/proc/self/clear_refs").write_text("5")
    before_mb = _status_mb("VmRSS")
    outcome = run.compute_here(run.work(job.stage, job.index))
    assert outcome.manifest is not None
    return before_mb, _status_mb("VmHWM"), outcome.manifest.ref


def _status_mb(field: str) -> float:
    lines = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    return int(lines[field].split()[0]) / 1024
