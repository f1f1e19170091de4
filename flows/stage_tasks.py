"""One Prefect task for each unit of a video: submitted stage by stage, finished with the run folder.

A task waits for the tasks whose artifacts it reads; the engine (`humanmm.tasks.engine.run`) finds or computes its unit.
"""

import contextlib
import logging
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from types import TracebackType
from typing import Any
from uuid import UUID

from prefect import Task, allow_failure, task
from prefect.cache_policies import NO_CACHE
from prefect.client.schemas.objects import State, TaskRun
from prefect.futures import PrefectConcurrentFuture
from prefect.runtime import flow_run, task_run
from prefect.states import Completed, Failed
from prefect.task_runners import ThreadPoolTaskRunner

from humanmm.errors import HumanMMError, NoUsablePersonError, StoreError
from humanmm.flows.server.dashboard import ProgressBoard, show_failure, show_video
from humanmm.flows.server.liveness import write_process_id
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.signals import held
from humanmm.tasks.engine.finish import (
    failures,
    fatal_error,
    has_result,
    remember,
    stage_record,
    write_results,
)
from humanmm.tasks.engine.run import VideoRun
from humanmm.tasks.pictures import write_candidates
from humanmm.tasks.pipeline import Stage
from humanmm.tasks.units.faults import in_words, is_infrastructure_fault
from humanmm.tasks.units.process import treat_as_sigterm
from humanmm.tasks.units.unit import Unit, UnitId

log = logging.getLogger(__name__)

MAX_WAITING = 32
"""Tasks that may wait for their inputs at the same time, at least; how many compute is `run.threads`."""

ASLEEP_S = 0.25
"""Seconds between two looks for signals while tasks compute."""


class StageTasks:
    """Submits the tasks of one stage after another, and ends the flow run."""

    def __init__(self, run: VideoRun, run_dir: Path) -> None:
        self.run = run
        self.run_dir = run_dir
        write_process_id()
        self._board = ProgressBoard(UUID(str(flow_run.id)))
        run.listen(self._board.report)
        self._futures: dict[UnitId, PrefectConcurrentFuture[Any]] = {}
        self._stopped = False
        self._runner: ThreadPoolTaskRunner[Any] = ThreadPoolTaskRunner(max(MAX_WAITING, run.config.run.threads))

    def __enter__(self) -> "StageTasks":
        treat_as_sigterm()
        self._runner.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.run.close()
        finally:  # another Ctrl-C meets `close` as well
            if kind is not None:
                self._abandon()
        self._runner.__exit__(kind, error, trace)
        self._board.end()

    def _abandon(self) -> None:
        """Do not wait for the threads that compute: they cannot be stopped, and end with their unit or the process.

        On whatever error: where SIGTERM or Ctrl-C meets pydantic's serialiser, it raises an Exception of its own.
        """
        executor = self._runner._executor  # Prefect's runner waits, and has no option against it
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
        units = self.run.units(stage)
        self._stopped = units is None  # the stage that defines the units has failed
        for unit in units or ():
            parameters = {"run": self.run, "stage": name, "index": unit.index, "board": self._board}
            inputs: list[Any] = [allow_failure(future) for future in self._inputs(unit)]
            with held():
                self._futures[unit.id] = self._runner.submit(_task_of(self.run, unit), parameters, wait_for=inputs)

    def finish(self, begun: float) -> Any:
        """Wait for everything; write the run folder; the flow's final state."""
        for future in self._futures.values():
            _wait_for(future)
        error = fatal_error(self.run)
        if error is not None:
            with contextlib.suppress(StoreError):  # the fatal error is the one to raise
                remember(self.run, "failed", run_dir=None, reason=str(error))
            if isinstance(error, NoUsablePersonError):
                error = self._with_picture(error)
            raise error
        if not has_result(self.run):  # `--only` left the result as it was
            return Completed(message="nothing that depends on it has changed")
        state = write_results(self.run, self.run_dir, started=begun, log_text=self.run.log_text())
        show_video(self.run_dir.absolute(), UUID(str(flow_run.id)))
        if state == "partial":
            lost = "; ".join(f"{outcome.unit.label}: {outcome.reason}" for outcome in failures(self.run))
            return Failed(name="Partial", message=lost)
        return Completed(message=os.fspath(self.run_dir))

    def _with_picture(self, error: NoUsablePersonError) -> NoUsablePersonError:
        """The error, with a picture of those who were seen and are not usable, if one can be written."""
        folder = self.run_dir if self.run_dir.name.strip(".") else self.run_dir.resolve()  # `.` has no name
        path = folder.with_name(f"{folder.name}.seen.png")
        read = self.run.read
        try:
            (decoded,) = self.run.units(self.run.stage("decode")) or ()
            units = self.run.units(self.run.stage("people")) or ()
            scenes = [read(unit, ScenePeople) for unit in units if self.run.manifest(*unit.id)]
            with self.run.video.open() as stream:
                write_candidates(path, stream, read(decoded, VideoFacts), scenes)
        except (HumanMMError, OSError) as trouble:
            log.warning("no picture of those who were seen: %s", trouble)
            return error
        return NoUsablePersonError(f"{error}; {path} shows who was seen")

    def _inputs(self, unit: Unit) -> list[PrefectConcurrentFuture[Any]]:
        sources = [self.run.stage(name) for name in unit.stage.inputs]
        needed = [needed.id for source in sources for needed in self.run.inputs_of(unit, source)]
        return [self._futures[at] for at in needed if at in self._futures]

    def _is_wanted(self, stage: Stage) -> bool:
        """With `--only STAGE`, the stages after it run only if its output changed."""
        only = self.run.selection.only
        names = [s.name for s in self.run.stages]
        if only is None or names.index(stage.name) <= names.index(only):
            return True
        self._wait(only)
        return any(o.changed for o in self.run.outcomes.values() if o.unit.stage.name == only)

    def _wait(self, name: str) -> None:
        for (stage, _), future in self._futures.items():
            if stage == name:
                _wait_for(future)


@dataclass
class Failing:
    """What a video that may fail has: its run folder, and its run; None until it was opened."""

    run_dir: Path
    run: VideoRun | None = None


@contextlib.contextmanager
def showing_failure(video: Path, run_dir: Path) -> Iterator[Failing]:
    """Put a page on the dashboard if the video ends with an error, as a finished one has."""
    failing = Failing(run_dir)
    try:
        yield failing
    except Exception as error:
        run = failing.run
        stages = [] if run is None else [asdict(stage_record(outcome)) for outcome in run.outcomes.values()]
        sha256 = None if run is None else run.video.sha256
        show_failure(video, in_words(error), stages, failing.run_dir.absolute(), UUID(str(flow_run.id)), sha256=sha256)
        raise


def stage_task(run: VideoRun, stage: str, index: int, board: ProgressBoard) -> Any:
    """Find or compute one unit; the state of the task says which, its result is a small reference."""
    unit = run.unit(stage, index)
    board.begin(unit, UUID(str(task_run.id)))
    outcome = run.execute(unit)
    if outcome.manifest is None:  # Prefect has no type for it; one that failed is not what this is
        return Completed(name="Skipped", message=outcome.reason)
    if outcome.state == "cached":
        return Completed(name="Cached", data=outcome.manifest.ref)
    return Completed(message=outcome.reason, data=outcome.manifest.ref)


def _wait_for(future: PrefectConcurrentFuture[Any]) -> None:
    """Wait until a task has ended, and be stopped meanwhile.

    A signal that comes after Python has looked for one and before it sleeps does not wake it: the sleeps are short.
    """
    while not future.wrapped_future.done():
        future.wait(timeout=ASLEEP_S)
    future.wait()


def _task_of(run: VideoRun, unit: Unit) -> Task[..., Any]:
    retries = run.config.run.max_retries
    named: Task[..., Any] = task(name=unit.stage.name)(stage_task)
    return named.with_options(
        task_run_name=unit.label,
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
