"""How much main memory each stage takes: every unit in a fresh process, one after the other.

Measured is the peak growth of the resident memory of that process above what it has with the code of all stages loaded:
decoded inputs, pictures, the networks that it loads, and the result while it is written.
"""

import contextlib
import multiprocessing
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from humanmm.config import Config
from humanmm.errors import UsageError
from humanmm.storage.store.artifact import Ref
from humanmm.storage.store.identity import identify
from humanmm.storage.store.store import Store
from humanmm.tasks import pipeline
from humanmm.tasks.engine.runners.job import Job, Setting
from humanmm.tasks.units.process import prepare_process
from humanmm.tasks.units.selection import Selection


@dataclass(frozen=True)
class UnitMemory:
    """The memory of one unit."""

    stage: str
    unit: str
    before_mb: float
    """Of a process that has the code of all stages loaded."""
    grown_mb: float
    """Peak growth above that."""


def measure_memory(video: Path, config: Config, store: Store) -> Iterator[UnitMemory]:
    """Compute every unit of a video, also those that the store has, and measure each. On Linux only."""
    if sys.platform != "linux":
        raise UsageError(f"the memory of a stage is read from /proc, which {sys.platform} does not have: use Linux")
    selection = Selection(force=True)
    setting = Setting(identify(video, store), config, store, selection, pipeline.STAGES)
    executor = setting.open()
    fresh = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=fresh, max_tasks_per_child=1) as process:
        for stage in executor.stages:
            for unit in executor.units(stage) or ():
                job = Job(*unit.id, executor.references(unit))
                before_mb, peak_mb, ref = process.submit(_compute, setting, job).result()
                executor.adopt({unit.id: ref})
                yield UnitMemory(stage.name, unit.name, before_mb, peak_mb - before_mb)


def _compute(setting: Setting, job: Job) -> tuple[float, float, Ref]:
    """Memory before and at its peak, MB, and the artifact."""
    prepare_process()
    executor = setting.open()
    executor.imports.prepare(executor.stages[0])
    executor.adopt(job.references)
    with contextlib.suppress(OSError):  # without it the peak is that since the start of the process
        Path("/proc/self/clear_refs").write_text("5")
    before_mb = _status_mb("VmRSS")
    result = executor.compute(executor.unit(job.stage, job.index))
    return before_mb, _status_mb("VmHWM"), result.manifest.ref


def _status_mb(field: str) -> float:
    lines = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    return int(lines[field].split()[0]) / 1024
