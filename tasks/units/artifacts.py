"""What one run has of a video: the artifact of each unit found or computed so far, and the units that follow from them.

The stages `scenes` and `shots` define the units of the stages after them: until their artifacts are there, the units of
a stage per scene or per shot are unknown.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, TypeVar, cast

from humanmm.errors import MissingInputError, StoreError
from humanmm.models.records.shots import Scenes, ShotList
from humanmm.storage.store.artifact import Manifest, Ref
from humanmm.storage.store.store import Store
from humanmm.tasks.pipeline import Stage, UnitKind
from humanmm.tasks.units.unit import Unit, UnitId, read_by, units_of

T = TypeVar("T")
State = Literal["cached", "computed", "failed", "skipped"]


@dataclass
class Outcome:
    """What became of one unit in this run."""

    unit: Unit
    state: State = "failed"
    manifest: Manifest | None = None
    reason: str = ""
    """Why it was computed, why it failed, or which failure it was skipped for."""
    began: float | None = None
    """When its first attempt began, seconds since 1970; None if nothing was computed."""
    seconds: float = 0.0
    """Spent on it in this run, all attempts together."""
    faults: list[str] = field(default_factory=list)
    """The error of each attempt that failed."""
    attempts: int = 0
    error: Exception | None = None
    short_of_memory: bool = False
    """Whether its last attempt ran out of memory: the next one then runs while no other stage of the video does."""
    changed: bool = True
    """Whether the output differs from the one before this run."""


class Artifacts:
    """The units of one video and the artifacts that this run has of them, in one store."""

    def __init__(self, store: Store, stages: tuple[Stage, ...]) -> None:
        self.store = store
        self.stages = stages
        self.outcomes: dict[UnitId, Outcome] = {}
        self._by_name = {stage.name: stage for stage in stages}
        self._decoded: dict[str, Any] = {}
        """Content digest → what `decode` and the definitions of units say; decoded once."""
        self._units: dict[tuple[str, int, int], tuple[Unit, ...] | None] = {}

    def stage(self, name: str) -> Stage:
        """A stage of the pipeline by its name."""
        return self._by_name[name]

    def upstream(self, stage: Stage) -> set[str]:
        """Names of all stages that a stage depends on, directly or not."""
        names = set(stage.inputs)
        return names.union(*(self.upstream(self.stage(name)) for name in stage.inputs))

    # ---- units

    def units(self, stage: Stage) -> tuple[Unit, ...] | None:
        """Units of a stage; None while the artifact that defines them is missing."""
        scenes = self.definition("scene", Scenes) if stage.per == "scene" else None
        shots = self.definition("shot", ShotList) if stage.per == "shot" else None
        at = (stage.name, id(scenes), id(shots))  # the definitions live as long as the run
        if at not in self._units:
            self._units[at] = units_of(stage, scenes, shots)
        return self._units[at]

    def unit(self, stage: str, index: int = 0) -> Unit:
        """One unit of a stage whose units are known."""
        units = self.units(self.stage(stage))
        if units is None:
            raise MissingInputError(f"the units of {stage} are not known yet")
        return units[index]

    def inputs_of(self, unit: Unit, source: Stage) -> Sequence[Unit]:
        """The units of an input stage that a unit reads."""
        return read_by(unit, source, self.units(source) or ())

    def dependencies(self, unit: Unit) -> list[Unit]:
        """What a unit reads, and what defines units."""
        found: list[Unit] = []
        for source in self.stages:
            reads = source.name in unit.stage.inputs
            found += self.inputs_of(unit, source) if reads else [Unit(source)] if source.defines else []
        return found

    # ---- their artifacts

    def manifest(self, stage: str, index: int = 0) -> Manifest | None:
        """Manifest of one unit's artifact, if this run has it."""
        outcome = self.outcomes.get((stage, index))
        return outcome.manifest if outcome else None

    def read(self, unit: Unit, output: type[T]) -> T:
        """The decoded artifact of one unit, of the content that this run found: keys of what reads it name that."""
        manifest = self.manifest(*unit.id)
        if manifest is None:
            raise MissingInputError(f"the artifact of {unit.label} is not in the store")
        found = self.store.read(manifest.ref, output)
        if not self.store.is_current(manifest.ref):
            raise StoreError(f"another process has replaced {unit.label} by a result of another content; run again")
        return found

    def read_once(self, unit: Unit, output: type[T]) -> T | None:
        """The same, kept in memory; None if this run does not have it."""
        manifest = self.manifest(*unit.id)
        if manifest is None:
            return None
        if manifest.digest not in self._decoded:
            self._decoded[manifest.digest] = self.read(unit, output)
        return cast(T, self._decoded[manifest.digest])

    def definition(self, kind: UnitKind, output: type[T]) -> T | None:
        """The artifact that lists all units of a kind; None if this run does not have it."""
        return next((self.read_once(Unit(stage), output) for stage in self.stages if stage.defines == kind), None)

    # ---- in another process

    def references(self, unit: Unit) -> dict[UnitId, Ref | None]:
        """References to the artifacts that another process needs to compute a unit; None for a unit that failed."""
        found = {}
        for needed in self.dependencies(unit):
            outcome = self.outcomes.get(needed.id)
            if outcome is not None:
                found[needed.id] = outcome.manifest.ref if outcome.manifest else None
        return found

    def adopt(self, references: Mapping[UnitId, Ref | None]) -> None:
        """Take over the artifacts of a run in another process."""
        for stage in self.stages:  # in order: some define the units of others
            for at in sorted(at for at in references if at[0] == stage.name):
                ref = references[at]
                manifest = self.store.manifest(ref) if ref else None
                state: State = "cached" if ref else "failed"
                self.outcomes[at] = Outcome(self.unit(*at), state, manifest, changed=False)
