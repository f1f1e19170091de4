"""One video with cuts → one continuous human motion in one metric world: the figure of the paper as a Prefect flow.

Our store is the truth, not Prefect's result cache: a task asks the store first and ends as `Cached` when the store
answers. Prefect shows every stage × unit, retries infrastructure faults, and runs independent units at the same time.
"""

import contextlib
import contextvars
import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any
from uuid import UUID

from prefect import Task, allow_failure, flow, task
from prefect.cache_policies import NO_CACHE
from prefect.client.schemas.objects import State, TaskRun
from prefect.futures import PrefectFuture
from prefect.runtime import flow_run, task_run
from prefect.states import Completed, Failed
from prefect.task_runners import ThreadPoolTaskRunner

from humanmm.config import Config
from humanmm.errors import StoreError
from humanmm.flows.gpu import gpu_slot
from humanmm.flows.server.dashboard import ProgressBoard, show_video
from humanmm.flows.server.liveness import Alive, home_of_our_server
from humanmm.storage.store.identity import identify
from humanmm.storage.store.open import open_store
from humanmm.storage.store.store import default_store
from humanmm.tasks.engine.faults import is_infrastructure_fault
from humanmm.tasks.engine.finish import default_run_dir, failures, fatal_error, has_result, remember, write_results
from humanmm.tasks.engine.run import Outcome, VideoRun
from humanmm.tasks.engine.runners.runner import check_runner
from humanmm.tasks.engine.selection import Selection
from humanmm.tasks.engine.units import Work
from humanmm.tasks.pipeline import Stage
from humanmm.tasks.process import prepare_process

MAX_WAITING = 32
"""Tasks that may wait for their inputs at the same time, at least; how many compute is `run.threads`."""

DEFAULTS, EVERYTHING = Config(), Selection()

opened: contextvars.ContextVar[Callable[[VideoRun], None] | None] = contextvars.ContextVar("opened", default=None)
"""Called with the run when the flow begins, by whoever wants to watch it (the command line's progress and log)."""


def _flow_run_name() -> str:
    return Path(flow_run.parameters.get("video", "video")).name[:100]


@flow(name="recover", flow_run_name=_flow_run_name, persist_result=False)
def recover(
    video: Path,
    out: Path | None = None,
    config: Config = DEFAULTS,
    store: Path | None = None,
    selection: Selection = EVERYTHING,
) -> Any:
    """Recover the people and cameras of one video into a run folder (default: runs/<name of the video>)."""
    begun = time.time()
    with Stages(_open(video, config, store, selection)) as stage:
        stage("decode")  # container facts, exact frame times
        stage("scenes")  # section 3.1: colour-based cuts and gradual transitions
        stage("people")  # per scene: boxes, 2D keypoints, 3D landmarks, masks, tracks
        stage("points")  # per scene: long tracks on whatever there is, beside `people`
        stage("shots")  # section 3.1: cuts from boxes and keypoints; who is who across cuts
        stage("keyframes")  # features of the background in each shot, beside what follows
        stage("intrinsics")  # one focal length for all shots
        stage("camera")  # per shot, section 3.2: masked visual odometry
        stage("hmr")  # per shot: θ, β, Γ, τ in camera axes
        stage("align")  # section 3.3.1: all shots into one world
        stage("refine")  # section 3.4: smooth motion, feet that stay where they stand
        stage("deliver")  # pictures and the recording

        return stage.finish(out, begun)


class Stages:
    """Submits the tasks of one stage after another; a task waits for the tasks whose artifacts it reads."""

    def __init__(self, run: VideoRun) -> None:
        self.run = run
        home = home_of_our_server()
        self._alive = Alive(home, str(flow_run.id)) if home and flow_run.id else None
        self._board = ProgressBoard(UUID(str(flow_run.id)))
        run.listen(self._board.report)
        self._futures: dict[tuple[str, int], PrefectFuture[Any]] = {}
        self._stopped = False
        self._runner: ThreadPoolTaskRunner[Any] = ThreadPoolTaskRunner(max(MAX_WAITING, run.config.run.threads))

    def __enter__(self) -> "Stages":
        self._runner.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.run.close()
        if kind is not None and not issubclass(kind, Exception):
            self._abandon()
        self._runner.__exit__(kind, error, trace)
        self._board.end()
        if self._alive is not None:
            self._alive.end()

    def _abandon(self) -> None:
        """Told to stop: do not wait for what computes in threads. They cannot be stopped, and end with the process."""
        executor = self._runner._executor  # Prefect's runner waits, and has no other way
        if executor is not None:
            executor.shutdown(wait=False, cancel_futures=True)
            self._runner._executor = None

    def __call__(self, name: str) -> None:
        """Submit one task per unit of a stage."""
        stage = self.run.stage(name)
        if self._stopped or not self._is_wanted(stage):
            return
        if stage.per != "video":
            self._wait(next(s.name for s in self.run.stages if s.defines == stage.per))
        works = self.run.works(stage)
        self._stopped = works is None  # what defines the units has failed
        for work in works or ():
            asked = {"run": self.run, "stage": name, "index": work.index, "board": self._board}
            inputs: list[Any] = [allow_failure(future) for future in self._inputs(work)]
            self._futures[name, work.index] = self._runner.submit(_task_of(self.run, work), asked, wait_for=inputs)

    def finish(self, out: Path | None, begun: float) -> Any:
        """Wait for everything; write the run folder; the flow's final state."""
        for future in self._futures.values():
            future.wait()
        error = fatal_error(self.run)
        if error is not None:
            with contextlib.suppress(StoreError):  # its own fault is the one to tell
                remember(self.run, "failed", run_dir=None, reason=str(error))
            raise error
        if not has_result(self.run):  # `--only` left the result as it was
            return Completed(message="nothing that depends on it has changed")
        run_dir = out or default_run_dir(self.run.video.path)
        state = write_results(self.run, run_dir, started=begun, log_text=self.run.log_text())
        show_video(run_dir.absolute(), UUID(str(flow_run.id)))
        if state == "partial":
            lost = "; ".join(f"{outcome.work.label}: {outcome.reason}" for outcome in failures(self.run))
            return Failed(name="Partial", message=lost)
        return Completed(message=os.fspath(run_dir))

    def _inputs(self, work: Work) -> list[PrefectFuture[Any]]:
        sources = [self.run.stage(name) for name in work.stage.inputs]
        wanted = [(source.name, need.index) for source in sources for need in self.run.needs_from(work, source)]
        return [self._futures[at] for at in wanted if at in self._futures]

    def _is_wanted(self, stage: Stage) -> bool:
        """With `--only STAGE`, what comes after it is looked at only if its output changed."""
        only = self.run.selection.only
        names = [s.name for s in self.run.stages]
        if only is None or names.index(stage.name) <= names.index(only):
            return True
        self._wait(only)
        outcomes: Sequence[Outcome] = [o for o in self.run.outcomes.values() if o.work.stage.name == only]
        return any(outcome.changed for outcome in outcomes)

    def _wait(self, name: str) -> None:
        for (stage, _), future in self._futures.items():
            if stage == name:
                future.wait()


def stage_task(run: VideoRun, stage: str, index: int, board: ProgressBoard) -> Any:
    """Find or compute one stage × unit; its state tells which, its result is a small reference."""
    work = run.work(stage, index)
    board.begin(work, UUID(str(task_run.id)))
    outcome = run.do(work)
    if outcome.manifest is None:
        return Failed(name="Skipped", message=outcome.reason)
    if outcome.state == "cached":
        return Completed(name="Cached", data=outcome.manifest.ref)
    return Completed(message=outcome.reason, data=outcome.manifest.ref)


def _task_of(run: VideoRun, work: Work) -> Task[..., Any]:
    retries = run.config.run.max_retries
    named: Task[..., Any] = task(name=work.stage.name)(stage_task)
    return named.with_options(
        task_run_name=work.label,
        cache_policy=NO_CACHE,
        persist_result=False,
        retries=retries,
        retry_delay_seconds=[0.5 * 4**attempt for attempt in range(retries)],
        retry_condition_fn=_is_worth_retrying,
    )


def _is_worth_retrying(task: Task[..., Any], task_run: TaskRun, state: State[Any]) -> bool:
    """Infrastructure faults only: bad input and failed stages would fail again."""
    result = state.result(raise_on_failure=False)
    return isinstance(result, BaseException) and is_infrastructure_fault(result)


def _open(video: Path, config: Config, store: Path | None, selection: Selection) -> VideoRun:
    prepare_process()
    check_runner(config.run)
    place = open_store(store or default_store())
    place.sweep()
    run = VideoRun(identify(video, place), config, place, selection=selection)
    run.gpu = gpu_slot
    selection.check(run.stages)
    listener = opened.get()
    if listener is not None:
        listener(run)
    return run
