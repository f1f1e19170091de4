"""Finds or computes one unit in this process. The store's lock on its key makes it be computed once over all processes.

The flow's process has a `VideoRun` (`humanmm.tasks.engine.run`), which adds the budget, other processes and what errors
mean; a child process or a worker has a `UnitExecutor` alone.
"""

import contextlib
import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Literal, TypeVar, cast

from humanmm.config import Config
from humanmm.errors import MissingInputError, StoreError
from humanmm.storage.store.artifact import Manifest
from humanmm.storage.store.identity import VideoIdentity
from humanmm.storage.store.store import Store
from humanmm.tasks import pipeline
from humanmm.tasks.pipeline import Stage
from humanmm.tasks.units.artifacts import Artifacts, Outcome
from humanmm.tasks.units.imports import Imports
from humanmm.tasks.units.inputs import UnitInputs
from humanmm.tasks.units.keys import Keys
from humanmm.tasks.units.selection import Selection
from humanmm.tasks.units.unit import Unit
from humanmm.version import __version__

log = logging.getLogger(__name__)
T = TypeVar("T")
Progress = Callable[[Unit, int, int], None]
"""Called with a unit, how much of it is done, and of how much."""


@dataclass(frozen=True)
class Result:
    """The artifact of one unit, and how this process came to have it."""

    state: Literal["cached", "computed"]
    """`cached` if another process computed it while this one waited for the lock."""
    manifest: Manifest
    reason: str
    changed: bool
    """Whether the output differs from the one before this run."""


class UnitExecutor(Artifacts):
    """Finds and computes units of one video with one configuration and one store."""

    def __init__(
        self,
        video: VideoIdentity,
        config: Config,
        store: Store,
        *,
        selection: Selection | None = None,
        stages: tuple[Stage, ...] | None = None,
    ) -> None:
        super().__init__(store, stages if stages is not None else pipeline.STAGES)
        self.video = video
        self.config = config
        self.selection = selection or Selection()
        self.keys = Keys(video, config, self)
        self.imports = Imports(self.stages)
        self._listeners: list[Progress] = []

    def listen(self, progress: Progress) -> None:
        """Report progress to one more listener."""
        self._listeners.append(progress)

    def report(self, unit: Unit, done: int, total: int) -> None:
        """Pass a stage's progress on to the listeners."""
        for progress in self._listeners:
            progress(unit, done, total)

    def units(self, stage: Stage) -> tuple[Unit, ...] | None:
        """As `Artifacts.units`; InputError if `--shot` names a shot that the video does not have."""
        units = super().units(stage)
        if stage.per == "shot" and units is not None:
            self.selection.check_shot(len(units))
        return units

    def look_up(self, unit: Unit) -> Manifest | None:
        """The artifact, if the store has it whole and it may be used; its unit is then done."""
        if self._forced_by(unit):
            return None
        manifest = self.store.find(unit.stage.name, self.keys.recipe(unit).key)
        if manifest is not None:
            self.outcomes[unit.id] = Outcome(unit, "cached", manifest, changed=False)
            if not self.store.read_only:
                self.store.remember(self.video.sha256, unit.record, manifest)
        return manifest

    def why(self, unit: Unit) -> str:
        """Why the store has no artifact to use: what changed since this unit was last computed."""
        forced = self._forced_by(unit)
        if forced:
            return f"forced by {forced}"
        recipe = self.keys.recipe(unit)
        damage = self.store.damage(unit.stage.name, recipe.key)
        if damage:
            return f"damaged artifact: {damage}"
        last = self.store.last_recipe(self.video.sha256, unit.stage.name, unit.record)
        if last is None:
            return "no artifact yet"
        return "; ".join(recipe.changes_since(last)) or "its artifact is gone from the store"

    def compute(self, unit: Unit) -> Result:
        """Compute a unit under the lock of its key, unless another process did so while this one waited for it."""
        stage, recipe = unit.stage, self.keys.recipe(unit)
        with self.store.lock(stage.name, recipe.key):
            found = None if self._forced_by(unit) else self.store.find(stage.name, recipe.key)
            if found is not None:
                return Result("cached", found, "computed by another process", changed=False)
            reason = self.why(unit)
            before = self.store.last_digest(self.video.sha256, stage.name, unit.record)
            with self.store.new_folder() as folder:
                inputs = UnitInputs(
                    unit, self, video=self.video, config=self.config, blob_dir=folder / "files",
                    progress=lambda done, total: self.report(unit, done, total),
                )  # fmt: skip
                began = time.monotonic()
                with self.video.unchanged() if stage.reads_video else contextlib.nullcontext():
                    value = self.imports.function(stage)(inputs)
                manifest = self.store.commit(
                    folder, value, output_type(stage), recipe,
                    unit=unit.name, seconds=time.monotonic() - began, version=__version__,
                )  # fmt: skip
        self.store.remember(self.video.sha256, unit.record, manifest)
        return Result("computed", manifest, reason, changed=manifest.digest != before)

    def read(self, unit: Unit, output: type[T]) -> T:
        """The decoded artifact of one unit; computed again if it was damaged after it had been found."""
        try:
            return super().read(unit, output)
        except StoreError as error:
            try:
                self.restore(unit)
            except MissingInputError:  # a child does not know what it was made of: its parent does
                raise error from None
            return super().read(unit, output)

    def restore(self, unit: Unit) -> None:
        """Compute an artifact of this run again if it was damaged after it had been found."""
        manifest = self.manifest(*unit.id)
        if manifest is None or self.store.read_only or self.store.find(unit.stage.name, manifest.recipe.key):
            return
        again = self.compute(unit)
        log.warning("%s was computed again (%s)", unit.label, again.reason)
        if again.manifest.digest != manifest.digest:
            raise StoreError(f"{unit.label} was damaged, and has another content when computed again; run again")

    def _forced_by(self, unit: Unit) -> str | None:
        return self.selection.forces(unit.stage, unit.index, self.stages)


def output_type(stage: Stage) -> type:
    """The class of a stage's results."""
    module, _, name = stage.output.partition(":")
    return cast(type, getattr(import_module(module), name))
