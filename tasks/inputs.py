"""What a stage's function is given: its unit, its settings, the artifacts it reads and the video's bytes."""

from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO, Protocol, TypeVar

from humanmm.config import Config
from humanmm.corrections import Corrections
from humanmm.models.records.shots import Shot

T = TypeVar("T")


class StageInputs(Protocol):
    """Everything that one unit sees; nothing else may influence its result."""

    config: Config
    """Only the sections that the stage names in `pipeline.STAGES` may be read (others raise)."""
    corrections: Corrections
    """The user's corrections that concern this unit: of the kinds that the stage names, of its own shot."""
    span: tuple[int, int]
    """Frames [start, end) of this unit: the whole video, the scene or the shot."""
    shot: Shot | None
    """The shot, for a stage per shot: as if it were the only one of the video (`index` and `scene` are 0)."""
    blob_dir: Path
    """A folder whose files become part of the artifact (pictures, video)."""

    def read(self, stage: str, output: type[T]) -> T:
        """The artifact of a stage for this unit (same unit or the coarser one that holds it).

        A stage per shot that reads `shots` sees its own shot alone, as number 0, and the people in it, their `area` 0:
        what it cannot see need not be computed again when it changes. A stage that does not see who is in the shots
        finds nobody in them. A stage per scene has its scene in `span`.
        """
        ...

    def read_all(self, stage: str, output: type[T]) -> Sequence[T | None]:
        """The artifacts of a finer stage, in order; None where that unit failed."""
        ...

    def open_video(self) -> BinaryIO:
        """The video's bytes, read-only, seekable; the caller closes it."""
        ...

    def progress(self, done: int, total: int) -> None:
        """Report progress; costs nothing without a listener."""
        ...
