"""What a stage's own function is given, from results in memory: the real table of stages says what it may read."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar, cast

from humanmm.config import Config
from humanmm.models.records.shots import Scenes, ShotList, Transition
from humanmm.storage.store.artifact import Manifest
from humanmm.storage.store.identity import VideoIdentity, identify
from humanmm.storage.store.open import open_store
from humanmm.tasks.pipeline import STAGES, UnitKind
from humanmm.tasks.units.artifacts import Artifacts
from humanmm.tasks.units.inputs import UnitInputs
from humanmm.tasks.units.unit import Unit

T = TypeVar("T")
NOWHERE = VideoIdentity(Path("film.mp4"), "0", None)
"""A video that cannot be opened."""


class _Held(Artifacts):
    """Artifacts that lie in no store."""

    def __init__(self, results: Mapping[str, Any]) -> None:
        super().__init__(cast(Any, None), STAGES)
        self._results = results

    def manifest(self, stage: str, index: int = 0) -> Manifest | None:
        found = self._results[stage]
        return cast(Manifest, found[index] if isinstance(found, Sequence) else found)

    def read(self, unit: Unit, output: type[T]) -> T:
        found = self.manifest(*unit.id)
        assert isinstance(found, output)
        return found

    def definition(self, kind: UnitKind, output: type[T]) -> T | None:
        return next((self._results[s.name] for s in STAGES if s.defines == kind and s.name in self._results), None)


def inputs_of(
    stage: str, results: Mapping[str, Any], index: int = 0, *, video: VideoIdentity = NOWHERE, **settings: Any
) -> UnitInputs:
    """The inputs of one unit. `results`: stage → its artifact, or those of all scenes or shots, None where one failed;
    settings as `camera={"static": True}`, corrections as `corrections=[{"kind": …}]`."""
    corrections = {"correction": settings.pop("corrections", [])}
    config = Config.model_validate({**settings, "corrections": corrections})
    held = _Held(results)
    unit = held.unit(stage, index)
    return UnitInputs(unit, held, video=video, config=config, blob_dir=Path("blobs"), progress=lambda *_: None)


def identity_of(path: Path) -> VideoIdentity:
    """A video that can be opened, as a run knows it."""
    return identify(path, open_store(path.with_name("store")))


def scenes_of(shots: ShotList) -> Scenes:
    """The scenes of a list of shots each of which is one."""
    return Scenes(shots.num_frames, tuple(Transition("cut", s.start, s.start, "scene") for s in shots.shots[1:]))
