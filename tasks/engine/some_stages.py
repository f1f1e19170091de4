"""Some stages of a video one after the other in this process, without a flow: for tables, and for cameras alone."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from humanmm.config import Config
from humanmm.errors import StageError
from humanmm.storage.store.identity import identify
from humanmm.storage.store.store import Store
from humanmm.tasks.engine.run import VideoRun
from humanmm.tasks.engine.runners.runner import check_runner

T = TypeVar("T")


def run_stages(
    video: Path,
    names: Sequence[str],
    config: Config,
    store: Store,
    *,
    follow: Callable[[VideoRun], None] = lambda run: None,
) -> VideoRun:
    """The run of a video after these stages, closed; StageError if one fails on a part of it. `follow` gets the run
    before."""
    check_runner(config.run)
    run = VideoRun(identify(video, store), config, store)
    follow(run)
    try:
        for name in names:
            for unit in run.units(run.stage(name)) or ():
                outcome = run.execute(unit)
                if outcome.manifest is None:
                    raise StageError(f"{video.stem}: {outcome.unit.label} failed: {outcome.reason}")
    finally:
        run.close()
    return run


def results_of(run: VideoRun, stage: str, output: type[T]) -> Sequence[T]:
    """What the units of a stage have left in the store."""
    manifests = [run.manifest(*unit.id) for unit in run.units(run.stage(stage)) or ()]
    return [run.store.read(manifest.ref, output) for manifest in manifests if manifest is not None]
