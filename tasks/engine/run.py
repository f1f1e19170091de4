"""One run on one video: each unit is found in the store, skipped, or computed within the run's budget.

Prefect is not needed here: `humanmm.flows.recover` makes a task of each `VideoRun.execute`, and
`humanmm.tasks.engine.plan` forecasts with the same object.
"""

import contextlib
import logging
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager

from humanmm.config import Config
from humanmm.errors import HumanMMError, NoUsablePersonError, ResourceError, StageError, VideoError
from humanmm.models.records.video import VideoFacts
from humanmm.storage.store.identity import VideoIdentity
from humanmm.storage.store.store import Store
from humanmm.tasks.engine.budget import budget_of, resources_of
from humanmm.tasks.engine.runners.job import Job, Setting
from humanmm.tasks.engine.runners.runner import workers_of
from humanmm.tasks.pipeline import Resources, Stage
from humanmm.tasks.units.artifacts import Outcome
from humanmm.tasks.units.execute import Result, UnitExecutor
from humanmm.tasks.units.faults import as_ours, ends_run, in_words, ran_out_of_memory
from humanmm.tasks.units.process import release_memory
from humanmm.tasks.units.selection import Selection
from humanmm.tasks.units.unit import Unit

log = logging.getLogger(__name__)

_LONG_S = 5.0
"""After units that took longer, freed memory goes back to the system: the next units start small, however long the
video."""


class VideoRun(UnitExecutor):
    """One video, one configuration, one store: what every unit's key is made of, and what has become of each."""

    def __init__(
        self,
        video: VideoIdentity,
        config: Config,
        store: Store,
        *,
        selection: Selection | None = None,
        stages: tuple[Stage, ...] | None = None,
    ) -> None:
        super().__init__(video, config, store, selection=selection, stages=stages)
        self.log_text: Callable[[], str] = str
        """Gives the log of this run; a caller that keeps it sets this."""
        self.gpu: Callable[[], AbstractContextManager[None]] = contextlib.nullcontext
        """Held while a stage computes that needs an accelerator; a caller that shares it with other runs sets this."""
        self.on_begin: Callable[[Unit], None] = lambda unit: None
        self.on_end: Callable[[Outcome], None] = lambda outcome: None
        """Called when a unit begins to be computed, and when it is known what became of it; a caller that shows the run
        sets them."""
        self._budget = budget_of(config.run)
        self._workers = workers_of(Setting(video, config, store, self.selection, self.stages))
        self._workers_lock = threading.Lock()
        self._is_closed = False
        self._fatal: Outcome | None = None
        """The outcome that makes all further units pointless: bad input, missing weights."""

    def execute(self, unit: Unit) -> Outcome:
        """Find or compute one unit. Raises what the stage raises, after noting it in `outcomes`."""
        try:
            return self._execute(unit)
        finally:
            self.on_end(self.outcomes[unit.id])

    def _execute(self, unit: Unit) -> Outcome:
        outcome = self.outcomes.setdefault(unit.id, Outcome(unit))
        if outcome.manifest is not None:
            return outcome
        started = time.monotonic()
        try:
            cause = self._failed_before(unit)
            if cause is not None:
                outcome.state, outcome.reason = "skipped", f"{cause.unit.label} failed: {cause.reason}"
                return outcome
            if self.look_up(unit) is not None:
                return self.outcomes[unit.id]
            outcome.attempts += 1
            needed = self._needed(unit)
            away = self.config.run.runner != "threads" or self.config.run.isolate or needed.limit_s is not None
            if away:
                self._open_workers(unit)
            else:
                self.imports.prepare(unit.stage)
            gpu = self.gpu() if needed.gpu else contextlib.nullcontext()
            with self._budget.taken(needed, alone=outcome.short_of_memory), gpu:
                self._check_open(unit)
                started = time.monotonic()
                outcome.began = outcome.began or time.time()
                self.on_begin(unit)
                result = self._compute_away(unit, needed.limit_s) if away else self.compute(unit)
        except Exception as error:  # noted, then raised: this is the edge of the stages
            ours = self._note_failure(outcome, error)
            if ours is error:
                raise
            raise ours from error
        finally:
            outcome.seconds += time.monotonic() - started
        outcome.state, outcome.error, outcome.reason = result.state, None, result.reason
        outcome.manifest, outcome.changed = result.manifest, result.changed
        if outcome.seconds > _LONG_S:
            release_memory()
        facts = {"video": str(self.video.path), "stage": unit.stage.name, "unit": unit.name, "seconds": outcome.seconds}
        log.info("%s: %.1f s (%s)", unit.label, outcome.seconds, outcome.reason, extra=facts)
        return outcome

    def close(self) -> None:
        """End the processes that compute for this run; the units under way there fail, and no unit begins any more."""
        with self._workers_lock:
            self._is_closed = True
            self._workers.close()

    def _open_workers(self, unit: Unit) -> None:
        with self._workers_lock:
            self._check_open(unit)
            self._workers.open()

    def _check_open(self, unit: Unit) -> None:
        if self._is_closed:
            raise ResourceError(f"{unit.label}: the run has ended")

    def _compute_away(self, unit: Unit, limit_s: float | None) -> Result:
        for needed in self.dependencies(unit):
            self.restore(needed)
        result = self._workers.compute(
            Job(unit.stage.name, unit.index, self.references(unit)),
            unit.label,
            isolated=self.config.run.isolate,
            limit_s=limit_s,
            progress=lambda done, total: self.report(unit, done, total),
        )
        expected = self.keys.recipe(unit)
        if result.manifest.recipe.key != expected.key:
            differs = "; ".join(result.manifest.recipe.changes_since(expected))
            raise StageError(f"{unit.label}: its worker is not as this process: {differs}")
        return result

    def _needed(self, unit: Unit) -> Resources:
        """What a unit may use, by the size of the video as far as that is known."""
        facts = self.read_once(Unit(self.stages[0]), VideoFacts)
        if facts is None:
            return resources_of(unit.stage, self.config.run)
        num_frames = facts.num_frames if unit.stage.per == "video" else unit.span[1] - unit.span[0]
        megapixels = facts.width * facts.height / 1e6
        return resources_of(unit.stage, self.config.run, megapixels=megapixels, num_frames=num_frames)

    def _failed_before(self, unit: Unit) -> Outcome | None:
        """The failure that makes a unit pointless: a fatal one anywhere, a failed input, all inputs of the video."""
        if self._fatal is not None:
            return self._fatal
        for name in unit.stage.inputs:
            wanted = [self.outcomes.get(needed.id) for needed in self.inputs_of(unit, self.stage(name))]
            lost = [outcome for outcome in wanted if outcome is not None and outcome.manifest is None]
            if lost and (unit.stage.per != "video" or len(lost) == len(wanted)):
                return lost[0]
        return None

    def _note_failure(self, outcome: Outcome, error: Exception) -> HumanMMError:
        """The error in our own words, noted; one about the video names the video, which a stage does not know."""
        ours = as_ours(error, outcome.unit.label)
        if isinstance(ours, VideoError | NoUsablePersonError) and str(self.video.path) not in str(ours):
            ours = type(ours)(f"{self.video.path}: {ours}{self._oddities(ours)}")
        outcome.state, outcome.error, outcome.reason = "failed", ours, in_words(ours)
        outcome.faults.append(outcome.reason)
        outcome.short_of_memory = ran_out_of_memory(error) or isinstance(error, ResourceError)
        if ends_run(ours):
            self._fatal = outcome
        return ours

    def _oddities(self, error: HumanMMError) -> str:
        """What is odd about the file: where nobody is found in it, that may be why."""
        facts = self.read_once(Unit(self.stages[0]), VideoFacts) if isinstance(error, NoUsablePersonError) else None
        return f" (of the file: {'; '.join(facts.warnings)})" if facts is not None and facts.warnings else ""
