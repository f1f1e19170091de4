"""Computes one stage × unit of one video, or finds it in the store.

Prefect is not needed here: `humanmm.flows.recover` wraps `VideoRun.do` into tasks, `plan` asks the same object what
would happen.
"""

import contextlib
import importlib
import logging
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Any, Literal, TypeVar, cast

from humanmm import parts
from humanmm.config import Config
from humanmm.errors import (
    HumanMMError,
    MissingInputError,
    NoUsablePersonError,
    ResourceError,
    StageError,
    StoreError,
    VideoError,
)
from humanmm.models.records.shots import Scenes, ShotList
from humanmm.models.records.video import VideoFacts
from humanmm.storage.store.artifact import Manifest
from humanmm.storage.store.codec import encode
from humanmm.storage.store.digest import CodeDigest, code_digest
from humanmm.storage.store.identity import VideoIdentity
from humanmm.storage.store.recipe import Recipe
from humanmm.storage.store.refs import Ref
from humanmm.storage.store.store import Store
from humanmm.tasks import pipeline
from humanmm.tasks.engine.budget import Budget, resources_of
from humanmm.tasks.engine.faults import as_ours, ends_run, in_words, ran_out_of_memory
from humanmm.tasks.engine.imports import Imports
from humanmm.tasks.engine.job import Job, Setting
from humanmm.tasks.engine.runners.runner import workers_of
from humanmm.tasks.engine.selection import Selection
from humanmm.tasks.engine.unit_inputs import UnitInputs
from humanmm.tasks.engine.units import Work, needs_of, only_its_shot, works_of
from humanmm.tasks.pipeline import Resources, Stage
from humanmm.tasks.process import give_back_memory
from humanmm.version import __version__

log = logging.getLogger(__name__)

_LONG_S = 5.0
"""After units that took longer the memory is tidied up: those after them start small, however long the video."""
T = TypeVar("T")
Progress = Callable[[Work, int, int], None]
State = Literal["cached", "computed", "failed", "skipped"]


@dataclass
class Outcome:
    """What became of one stage × unit in this run."""

    work: Work
    state: State = "failed"
    manifest: Manifest | None = None
    reason: str = ""
    """Why it was computed, why it failed, or what it was skipped for."""
    began: float | None = None
    """When its first attempt began, seconds since 1970; None if nothing was computed."""
    seconds: float = 0.0
    """Spent on it in this run, all attempts together."""
    faults: list[str] = field(default_factory=list)
    """What went wrong in each attempt that failed."""
    attempts: int = 0
    error: Exception | None = None
    short_of_memory: bool = False
    """Whether its last attempt ran out of memory: the next one then runs while no other stage of the video does."""
    changed: bool = True
    """Whether the output differs from what was there before this run."""


class VideoRun:
    """One video, one configuration, one store: what every stage's key is made of, and what has become of each."""

    def __init__(
        self,
        video: VideoIdentity,
        config: Config,
        store: Store,
        *,
        selection: Selection | None = None,
        stages: tuple[Stage, ...] | None = None,
    ) -> None:
        self.video = video
        self.config = config
        self.store = store
        self.selection = selection or Selection()
        self.stages = stages if stages is not None else pipeline.STAGES
        self.outcomes: dict[tuple[str, int], Outcome] = {}
        self._by_name = {stage.name: stage for stage in self.stages}
        self._listeners: list[Progress] = []
        self.log_text: Callable[[], str] = str
        self._budget = Budget(threads=config.run.threads, memory_mb=config.run.memory_mb)
        self._workers = workers_of(Setting(video, config, store, self.selection, self.stages))
        self._workers_lock = threading.Lock()
        self._is_closed = False
        self.gpu: Callable[[], AbstractContextManager[None]] = contextlib.nullcontext
        """Held while a stage computes that needs an accelerator; whoever knows the others that want it sets it."""
        self._definitions: dict[str, Any] = {}
        self._code: dict[str, CodeDigest] = {}
        self._code_lock = threading.Lock()
        self._doom: Outcome | None = None
        self.imports = Imports(self.stages)
        self._works: dict[tuple[str, int, int], tuple[Work, ...] | None] = {}

    def watch(self, progress: Progress, *, log_text: Callable[[], str]) -> None:
        """Have progress reported, and name where this run's log can be had."""
        self.listen(progress)
        self.log_text = log_text

    def listen(self, progress: Progress) -> None:
        """Have progress reported, besides to whoever else listens."""
        self._listeners.append(progress)

    def report(self, work: Work, done: int, total: int) -> None:
        """Pass a stage's progress on to whoever listens."""
        for progress in self._listeners:
            progress(work, done, total)

    # ---- what there is to do

    def stage(self, name: str) -> Stage:
        return self._by_name[name]

    def works(self, stage: Stage) -> tuple[Work, ...] | None:
        """Units of a stage; None while the artifact that defines them is missing."""
        scenes = self.defined("scene", Scenes) if stage.per == "scene" else None
        shots = self.defined("shot", ShotList) if stage.per == "shot" else None
        at = (stage.name, id(scenes), id(shots))  # the definitions live as long as the run
        if at not in self._works:
            works = works_of(stage, scenes, shots)
            if shots is not None and works is not None:
                self.selection.check_shot(len(works))
            self._works[at] = works
        return self._works[at]

    def work(self, stage: str, index: int = 0) -> Work:
        """One unit of a stage whose units are known."""
        works = self.works(self.stage(stage))
        if works is None:
            raise MissingInputError(f"the units of {stage} are not known yet")
        return works[index]

    def manifest(self, stage: str, index: int = 0) -> Manifest | None:
        """Manifest of one unit's artifact, if this run has it."""
        outcome = self.outcomes.get((stage, index))
        return outcome.manifest if outcome else None

    def needs_from(self, work: Work, source: Stage) -> list[Work]:
        """The units of an input stage that a piece of work reads."""
        units = self.works(source) or ()
        return [units[i] for i in needs_of(work, source.name, source.per, units)]

    def upstream(self, stage: Stage) -> set[str]:
        """Names of all stages that a stage depends on, directly or not."""
        names = set(stage.inputs)
        return names.union(*(self.upstream(self.stage(name)) for name in stage.inputs))

    # ---- one stage × unit

    def code(self, stage: Stage) -> CodeDigest:
        """The code of a stage as it was when this run first asked for it."""
        with self._code_lock:  # CPython 3.11 fails now and then when two threads parse at once (gh-106905)
            if stage.name not in self._code:
                self._code[stage.name] = code_digest(stage.function[0], parts.chosen(self.config, stage.settings))
            return self._code[stage.name]

    def recipe(self, work: Work) -> Recipe:
        """Everything that decides the result; MissingInputError names an artifact that is not there yet."""
        stage = work.stage
        code = self.code(stage)
        return Recipe(
            stage=stage.name,
            schema_version=stage.schema_version,
            unit=work.parameters,
            modules=code.modules,
            weights=code.weights,
            libraries=code.libraries,
            settings={name: getattr(self.config, name).model_dump(mode="json") for name in stage.settings},
            inputs=self._input_digests(work),
        )

    def look_up(self, work: Work) -> Manifest | None:
        """The artifact, if the store has it whole and it may be used; its unit then counts as done."""
        if self.selection.forces(work.stage, work.index, self.stages):
            return None
        manifest = self.store.find(work.stage.name, self.recipe(work).key)
        if manifest is not None:
            self.outcomes[work.stage.name, work.index] = Outcome(work, "cached", manifest, changed=False)
            if not self.store.read_only:
                self.store.remember(self.video.sha256, work.record, manifest)
        return manifest

    def why(self, work: Work) -> str:
        """Why the store cannot answer: what changed since this unit was last computed."""
        forced = self.selection.forces(work.stage, work.index, self.stages)
        if forced:
            return f"forced by {forced}"
        recipe = self.recipe(work)
        damage = self.store.damage(work.stage.name, recipe.key)
        if damage:
            return f"damaged artifact: {damage}"
        last = self.store.last_recipe(self.video.sha256, work.stage.name, work.record)
        if last is None:
            return "no artifact yet"
        return "; ".join(recipe.changes_since(last)) or "its artifact is gone from the store"

    def do(self, work: Work) -> Outcome:
        """Find or compute one stage × unit. Raises what the stage raises, after noting it in `outcomes`."""
        at = (work.stage.name, work.index)
        outcome = self.outcomes.setdefault(at, Outcome(work))
        if outcome.manifest is not None:
            return outcome
        started = time.monotonic()
        try:
            blocked = self._blocked_by(work)
            if blocked is not None:
                outcome.state, outcome.reason = "skipped", f"{blocked.work.label} failed: {blocked.reason}"
                return outcome
            if self.look_up(work) is not None:
                return self.outcomes[at]
            outcome.attempts += 1
            needed = self._needed(work)
            away = self.config.run.runner != "threads" or self.config.run.isolate or needed.limit_s is not None
            if away:
                self._open_workers(work)
            else:
                self.imports.prepare(work.stage)
            with self._budget.taken(needed, alone=outcome.short_of_memory), self._accelerator(needed):
                started = time.monotonic()
                outcome.began = outcome.began or time.time()
                if away:
                    self._compute_away(work, outcome, needed.limit_s)
                else:
                    self._compute(work, outcome)
        except Exception as error:  # noted, then raised: this is the edge of the stages
            told = self._told(error, work)
            outcome.state, outcome.error, outcome.reason = "failed", told, in_words(told)
            outcome.faults.append(outcome.reason)
            outcome.short_of_memory = ran_out_of_memory(error) or isinstance(error, ResourceError)
            if ends_run(told):
                self._doom = outcome
            if told is error:
                raise
            raise told from error
        finally:
            outcome.seconds += time.monotonic() - started
        facts = {"video": str(self.video.path), "stage": work.stage.name, "unit": work.unit, "seconds": outcome.seconds}
        if outcome.seconds > _LONG_S:
            give_back_memory()
        log.info("%s: %.1f s (%s)", work.label, outcome.seconds, outcome.reason, extra=facts)
        return outcome

    def close(self) -> None:
        """End what works for this run beside it; what was under way there fails."""
        with self._workers_lock:
            self._is_closed = True
            self._workers.close()

    def _open_workers(self, work: Work) -> None:
        with self._workers_lock:
            if self._is_closed:
                raise ResourceError(f"{work.label}: the run has ended")
            self._workers.open()

    def known_for(self, work: Work) -> dict[tuple[str, int], Ref | None]:
        """The artifacts that another process must know to compute a piece of work."""
        known = {}
        for need in self._known_elsewhere(work):
            outcome = self.outcomes.get((need.stage.name, need.index))
            if outcome is not None:
                known[need.stage.name, need.index] = outcome.manifest.ref if outcome.manifest else None
        return known

    def _known_elsewhere(self, work: Work) -> list[Work]:
        """What a piece of work reads, and what lists units."""
        found = []
        for source in self.stages:
            reads = source.name in work.stage.inputs
            found += self.needs_from(work, source) if reads else [Work(source)] if source.defines else []
        return found

    def know(self, known: Mapping[tuple[str, int], Ref | None]) -> None:
        """Take over the artifacts of a run in another process."""
        for stage in self.stages:  # in order: some define the units of others
            for at in sorted(at for at in known if at[0] == stage.name):
                ref = known[at]
                state: State = "cached" if ref else "failed"
                manifest = self.store.manifest(ref) if ref else None
                self.outcomes[at] = Outcome(self.work(*at), state, manifest, changed=False)

    def compute_here(self, work: Work) -> Outcome:
        """Compute one stage × unit in this process, whatever its limits."""
        outcome = Outcome(work)
        self._compute(work, outcome)
        return outcome

    def _accelerator(self, needed: Resources) -> AbstractContextManager[None]:
        return self.gpu() if needed.gpu else contextlib.nullcontext()

    def _compute_away(self, work: Work, outcome: Outcome, limit_s: float | None) -> None:
        for need in self._known_elsewhere(work):
            self.restore(need)
        done = self._workers.compute(
            Job(work.stage.name, work.index, self.known_for(work)),
            work.label,
            isolated=self.config.run.isolate,
            limit_s=limit_s,
            progress=lambda now, total: self.report(work, now, total),
        )
        expected = self.recipe(work)
        if done.manifest.recipe.key != expected.key:
            differs = "; ".join(done.manifest.recipe.changes_since(expected))
            raise StageError(f"{work.label}: its worker is not as this process: {differs}")
        outcome.state, outcome.error, outcome.reason = done.state, None, done.reason
        outcome.manifest, outcome.changed = done.manifest, done.changed

    def _compute(self, work: Work, outcome: Outcome) -> None:
        stage, recipe = work.stage, self.recipe(work)
        forced = self.selection.forces(stage, work.index, self.stages)
        with self.store.lock(stage.name, recipe.key):
            found = None if forced else self.store.find(stage.name, recipe.key)
            if found is not None:  # another process computed it while we waited for the lock
                outcome.state, outcome.manifest, outcome.changed = "cached", found, False
                outcome.reason = "computed by another process"
                return
            outcome.reason = self.why(work)
            before = self.store.last_digest(self.video.sha256, stage.name, work.record)
            with self.store.new_folder() as folder:
                inputs = UnitInputs(self, work, folder / "files")
                began = time.monotonic()
                result = self.imports.function(stage)(inputs)
                outcome.manifest = self.store.commit(
                    folder, result, _output(stage), recipe,
                    unit=work.unit, seconds=time.monotonic() - began, version=__version__,
                )  # fmt: skip
        outcome.state, outcome.error = "computed", None
        outcome.changed = outcome.manifest.digest != before
        self.store.remember(self.video.sha256, work.record, outcome.manifest)

    def _told(self, error: Exception, work: Work) -> HumanMMError:
        """The error in our own words; one about the video says which video, for a stage does not know its name."""
        told = as_ours(error, work.label)
        return type(told)(f"{self.video.path}: {told}") if isinstance(told, VideoError | NoUsablePersonError) else told

    # ---- inputs

    def read(self, work: Work, output: type[T]) -> T:
        """The decoded artifact of one stage × unit of this run."""
        manifest = self.manifest(work.stage.name, work.index)
        if manifest is None:
            raise MissingInputError(f"the artifact of {work.label} is not in the store")
        try:
            return self.store.read(manifest.ref, output)
        except StoreError as error:
            try:
                self.restore(work)
            except MissingInputError:  # a child does not know what it was made of: its parent does
                raise error from None
            return self.store.read(manifest.ref, output)

    def restore(self, work: Work) -> None:
        """Compute a result of this run again if it was damaged after it had been found."""
        manifest = self.manifest(work.stage.name, work.index)
        if manifest is None or self.store.read_only or self.store.find(work.stage.name, manifest.recipe.key):
            return
        again = Outcome(work)
        self._compute(work, again)
        log.warning("%s was computed again (%s)", work.label, again.reason)
        if again.manifest is None or again.manifest.digest != manifest.digest:
            raise StoreError(f"{work.label} was damaged, and has another content when computed again; run again")

    def _input_digests(self, work: Work) -> dict[str, str]:
        digests = {"video": self.video.sha256} if work.stage.reads_video else {}
        for name in work.stage.inputs:
            source = self.stage(name)
            if source.defines == work.stage.per:
                if source.defines == "shot":
                    digests["shot"] = self._shot_digest(work)
                continue  # a scene is its frames, which stand in `unit`
            for need in self.needs_from(work, source):
                label = need.label if work.stage.per == "video" else name
                digests[label] = self._digest(need)
        return digests

    def _digest(self, need: Work) -> str:
        outcome = self.outcomes.get((need.stage.name, need.index))
        if outcome is None:
            raise MissingInputError(f"the artifact of {need.label} is not in the store")
        return outcome.manifest.digest if outcome.manifest else "failed"

    def _shot_digest(self, work: Work) -> str:
        shots = self.defined("shot", ShotList)
        if shots is None:
            raise MissingInputError("the list of shots is not in the store")
        return encode(only_its_shot(shots, work), ShotList).digest()

    def defined(self, unit: str, output: type[T]) -> T | None:
        """The artifact that lists all units of a kind, decoded once."""
        for stage in self.stages:
            if stage.defines == unit:
                manifest = self.manifest(stage.name)
                if manifest is None:
                    return None
                return self._read_once(manifest, Work(stage), output)
        return None

    def _needed(self, work: Work) -> Resources:
        """What a unit may use, by the size of the video as far as that is known."""
        manifest = self.manifest(self.stages[0].name)
        if manifest is None:
            return resources_of(work.stage, self.config.run)
        facts = self._read_once(manifest, Work(self.stages[0]), VideoFacts)
        num_frames = facts.num_frames if work.stage.per == "video" else work.span[1] - work.span[0]
        return resources_of(
            work.stage, self.config.run, megapixels=facts.width * facts.height / 1e6, num_frames=num_frames
        )

    def _read_once(self, manifest: Manifest, work: Work, output: type[T]) -> T:
        if manifest.digest not in self._definitions:
            self._definitions[manifest.digest] = self.read(work, output)
        return cast(T, self._definitions[manifest.digest])

    def _blocked_by(self, work: Work) -> Outcome | None:
        """The failure that makes this work pointless: bad input anywhere, a failed input, all units for the video."""
        if self._doom is not None:
            return self._doom
        for name in work.stage.inputs:
            source = self.stage(name)
            wanted = [self.outcomes.get((name, need.index)) for need in self.needs_from(work, source)]
            lost = [outcome for outcome in wanted if outcome is not None and outcome.manifest is None]
            if lost and (work.stage.per != "video" or len(lost) == len(wanted)):
                return lost[0]
        return None


def _output(stage: Stage) -> type:
    module, _, name = stage.output.partition(":")
    return cast(type, getattr(importlib.import_module(module), name))
