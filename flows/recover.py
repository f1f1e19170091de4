"""One video with cuts → one continuous human motion in one metric world: the figure of the paper as a Prefect flow.

Our store decides what is computed, not Prefect's result cache: a task looks into the store first, and ends as `Cached`
when the artifact is there. Prefect shows every stage × unit, retries infrastructure faults, and runs independent units
at the same time.
"""

import contextvars
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from prefect import flow
from prefect.exceptions import TerminationSignal
from prefect.runtime import flow_run
from prefect.states import Cancelled

from humanmm.config import Config
from humanmm.flows.gpu import gpu_slot
from humanmm.flows.stage_tasks import StageTasks, showing_failure
from humanmm.storage.run_folder.corrections_file import decided
from humanmm.storage.store.identity import identify
from humanmm.storage.store.open import open_store
from humanmm.tasks.engine.finish import default_run_dir
from humanmm.tasks.engine.run import VideoRun
from humanmm.tasks.engine.run_folders import run_dir_of
from humanmm.tasks.engine.runners.runner import check_runner
from humanmm.tasks.units.process import passed_on, prepare_process
from humanmm.tasks.units.selection import Selection

DEFAULTS, EVERYTHING = Config(), Selection()

opened: contextvars.ContextVar[Callable[[VideoRun], None] | None] = contextvars.ContextVar("opened", default=None)
"""Called with the run when the flow begins; the caller of the flow sets it to follow progress and log."""


def video_name() -> str:
    """What the flow run is called."""
    return Path(flow_run.parameters.get("video", "video")).name[:100]


@flow(name="recover", flow_run_name=video_name, persist_result=False)
def recover(
    video: Path,
    out: Path | None = None,
    config: Config = DEFAULTS,
    store: Path | None = None,
    selection: Selection = EVERYTHING,
) -> Any:
    """Recover the people and cameras of one video into a run folder (default: runs/<name of the video>).

    A process that receives SIGTERM leaves a flow run that is `Cancelled`: Prefect would call it `Crashed`.
    """
    try:
        return recover_stages(video, out, config, store, selection)
    except (KeyboardInterrupt, TerminationSignal) as stop:
        number = stop.signal if isinstance(stop, TerminationSignal) else signal.SIGINT
        return Cancelled(message=f"stopped by {(passed_on() or signal.Signals(number)).name}")


def recover_stages(video: Path, out: Path | None, config: Config, store: Path | None, selection: Selection) -> Any:
    """The stages of `recover` in a flow run that has begun; returns its final state."""
    begun = time.time()
    with (
        showing_failure(video, out or default_run_dir(video)) as failed,
        StageTasks(*_open(video, out, config, store, selection)) as stage,
    ):
        failed.run, failed.run_dir = stage.run, stage.run_dir
        stage("decode")  # container facts, exact frame times
        stage("scenes")  # section 3.1: colour-based cuts and gradual transitions
        stage("people")  # per scene: boxes, 2D keypoints, 3D landmarks, masks, tracks
        stage("points")  # per scene: long point tracks, beside `people`
        stage("shots")  # section 3.1: cuts from boxes and keypoints; identities across cuts
        stage("keyframes")  # features of the background in each shot, beside what follows
        stage("intrinsics")  # one focal length for all shots
        stage("camera")  # per shot, section 3.2: masked visual odometry
        stage("hmr")  # per shot: θ, β, Γ, τ in camera axes
        stage("align")  # section 3.3.1: all shots into one world
        stage("refine")  # section 3.4: smooth motion, feet without sliding
        stage("deliver")  # pictures and the recording

        return stage.finish(begun)


def _open(
    video: Path, out: Path | None, config: Config, store: Path | None, selection: Selection
) -> tuple[VideoRun, Path]:
    """The run, and its folder."""
    prepare_process()
    check_runner(config.run)
    artifacts = open_store(store)
    artifacts.sweep()
    identity = identify(video, artifacts)
    run_dir = run_dir_of(identity, out, artifacts)
    config = decided(config, run_dir, sha256=identity.sha256)
    run = VideoRun(identity, config, artifacts, selection=selection)
    run.gpu = gpu_slot
    selection.check(run.stages)
    listener = opened.get()
    if listener is not None:
        listener(run)
    return run, run_dir
