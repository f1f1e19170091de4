"""What a stage's function is given, cut down to what its key is made of (see `humanmm.tasks.inputs.StageInputs`)."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, TypeVar, cast

from humanmm.config import Config
from humanmm.errors import StageError
from humanmm.models.records.shots import Scenes, Shot, ShotList
from humanmm.tasks.engine.units import Work, only_its_shot
from humanmm.tasks.pipeline import Stage

if TYPE_CHECKING:
    from humanmm.tasks.engine.run import VideoRun

T = TypeVar("T")


class UnitInputs:
    """What a stage's function is given (see `humanmm.tasks.inputs.StageInputs`)."""

    def __init__(self, run: "VideoRun", work: Work, blob_dir: Path) -> None:
        self._run = run
        self._work = work
        self.blob_dir = blob_dir
        self.shot: Shot | None = work.shot
        self.config = cast(Config, _NamedSettings(run.config, work.stage))
        self.span = work.span if work.stage.per != "video" else (0, self._num_frames())

    def read(self, stage: str, output: type[T]) -> T:
        source = self._source(stage)
        if source.defines == "scene" and self._work.stage.per == "scene":
            raise StageError(f"{self._work.stage.name} has its scene in `span`; the other scenes are not its business")
        if source.per != "video" and self._work.stage.per == "video":
            raise StageError(f"{self._work.stage.name} reads {stage}, which is per {source.per}: use read_all")
        value = self._run.read(self._run.needs_from(self._work, source)[0], output)
        if source.defines == "shot" and self._work.stage.per == "shot":
            return cast(T, only_its_shot(cast(ShotList, value), self._work))
        return value

    def read_all(self, stage: str, output: type[T]) -> Sequence[T | None]:
        source = self._source(stage)
        needed = self._run.needs_from(self._work, source)
        return [self._run.read(w, output) if self._run.manifest(stage, w.index) is not None else None for w in needed]

    def open_video(self) -> BinaryIO:
        if not self._work.stage.reads_video:
            raise StageError(f"{self._work.stage.name} opens the video without `reads_video` in pipeline.STAGES")
        return self._run.video.open()

    def progress(self, done: int, total: int) -> None:
        self._run.report(self._work, done, total)

    def _source(self, stage: str) -> Stage:
        if stage not in self._work.stage.inputs:
            raise StageError(f"{self._work.stage.name} reads {stage} without naming it in pipeline.STAGES")
        return self._run.stage(stage)

    def _num_frames(self) -> int:
        for scenes in (self._run.defined("scene", Scenes), self._run.defined("shot", ShotList)):
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
