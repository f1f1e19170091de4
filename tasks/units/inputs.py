"""What a stage's function is given, cut down to what its key is made of (see `humanmm.tasks.inputs.StageInputs`)."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO, TypeVar, cast

from humanmm.config import Config
from humanmm.errors import StageError
from humanmm.models.records.shots import Scenes, Shot, ShotList
from humanmm.storage.store.identity import VideoIdentity
from humanmm.tasks.pipeline import Stage
from humanmm.tasks.units.artifacts import Artifacts
from humanmm.tasks.units.keys import corrections_of
from humanmm.tasks.units.unit import Unit, seen_shot_list

T = TypeVar("T")


class UnitInputs:
    """`StageInputs` of one unit: reading what the table of stages does not name is an error."""

    def __init__(
        self,
        unit: Unit,
        artifacts: Artifacts,
        *,
        video: VideoIdentity,
        config: Config,
        blob_dir: Path,
        progress: Callable[[int, int], None],
    ) -> None:
        self._unit = unit
        self._artifacts = artifacts
        self._video = video
        self.blob_dir = blob_dir
        self._progress = progress
        self.shot: Shot | None = unit.shot
        if unit.shot is not None and not unit.stage.sees_people_of_shots:
            self.shot = replace(unit.shot, people=())
        self.config = cast(Config, _NamedSettings(config, unit.stage))
        self.corrections = corrections_of(config, unit)
        self.span = unit.span if unit.stage.per != "video" else (0, self._num_frames())

    def read(self, stage: str, output: type[T]) -> T:
        source = self._source(stage)
        if source.defines == "scene" and self._unit.stage.per == "scene":
            raise StageError(f"{self._unit.stage.name} has its scene in `span`; the other scenes are not its business")
        if source.per != "video" and self._unit.stage.per == "video":
            raise StageError(f"{self._unit.stage.name} reads {stage}, which is per {source.per}: use read_all")
        value = self._artifacts.read(self._artifacts.inputs_of(self._unit, source)[0], output)
        if source.defines == "shot":
            return cast(T, seen_shot_list(cast(ShotList, value), self._unit))
        return value

    def read_all(self, stage: str, output: type[T]) -> Sequence[T | None]:
        units = self._artifacts.inputs_of(self._unit, self._source(stage))
        return [self._artifacts.read(u, output) if self._artifacts.manifest(*u.id) is not None else None for u in units]

    def open_video(self) -> BinaryIO:
        if not self._unit.stage.reads_video:
            raise StageError(f"{self._unit.stage.name} opens the video without `reads_video` in pipeline.STAGES")
        return self._video.open()

    def progress(self, done: int, total: int) -> None:
        self._progress(done, total)

    def _source(self, stage: str) -> Stage:
        if stage not in self._unit.stage.inputs:
            raise StageError(f"{self._unit.stage.name} reads {stage} without naming it in pipeline.STAGES")
        return self._artifacts.stage(stage)

    def _num_frames(self) -> int:
        for scenes in (self._artifacts.definition("scene", Scenes), self._artifacts.definition("shot", ShotList)):
            if scenes is not None:
                return scenes.num_frames
        return 0


class _NamedSettings:
    """The configuration, restricted to the sections that are part of a stage's key."""

    def __init__(self, config: Config, stage: Stage) -> None:
        self._sections = {name: getattr(config, name) for name in stage.settings}
        self._stage = stage.name

    def __getattr__(self, name: str) -> Any:
        try:
            return self._sections[name]
        except KeyError:
            message = f"{self._stage} uses the settings {name!r} without naming them in pipeline.STAGES"
            raise StageError(message) from None
