"""The units that a video falls into: one stage on the whole video, on one scene, or on one shot."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from humanmm.models.records.shots import Scenes, Shot, ShotList
from humanmm.storage.store.codec import Json
from humanmm.tasks.pipeline import Stage, Unit


@dataclass(frozen=True)
class Work:
    """One stage × unit."""

    stage: Stage
    index: int = 0
    """Number of the scene or shot; 0 for the video."""
    span: tuple[int, int] = (0, 0)
    """Frames [start, end); (0, 0) for the whole video."""
    scene: int = 0
    """Number of the scene that holds it."""
    shot: Shot | None = None
    """What a stage per shot is told of its shot."""

    @property
    def unit(self) -> str:
        """`video`, `scene 2` or `shot 3`, as people read it."""
        return "video" if self.stage.per == "video" else f"{self.stage.per} {self.index}"

    @property
    def label(self) -> str:
        """Name of the task: `align`, `camera · shot 3`."""
        return self.stage.name if self.stage.per == "video" else f"{self.stage.name} · {self.unit}"

    @property
    def record(self) -> str:
        """Name under which the store remembers it: by frames, so that a new cut renames no other unit."""
        return "video" if self.stage.per == "video" else f"{self.stage.per}-{self.span[0]}-{self.span[1]}"

    @property
    def parameters(self) -> dict[str, Json]:
        """Its part of the key. What else a shot is made of stands in the digest of its own part of the shot list."""
        return {} if self.stage.per == "video" else {"start": self.span[0], "end": self.span[1]}


def works_of(stage: Stage, scenes: Scenes | None, shots: ShotList | None) -> tuple[Work, ...] | None:
    """All units of a stage in order; None as long as the artifact that defines them is not known."""
    if stage.per == "video":
        return (Work(stage),)
    if stage.per == "scene":
        return None if scenes is None else tuple(Work(stage, i, span, i) for i, span in enumerate(scenes.spans))
    if shots is None:
        return None
    return tuple(
        Work(stage, shot.index, (shot.start, shot.end), shot.scene, replace(shot, index=0, scene=0))
        for shot in shots.shots
    )


def needs_of(work: Work, name: str, per: Unit, units: Sequence[Work]) -> Iterator[int]:
    """Which units of an input stage, given by name and unit kind, a piece of work reads."""
    if per == "video":
        yield 0
    elif work.stage.per == "video":
        yield from range(len(units))
    elif per == work.stage.per:
        yield work.index
    elif per == "scene":
        yield work.scene
    else:
        raise ValueError(f"{work.stage.name} is per {work.stage.per} and cannot read {name}, which is per {per}")


def only_its_shot(shots: ShotList, work: Work) -> ShotList:
    """The shot list as a stage per shot sees it: its shot as number 0, its people without their video-wide area."""
    assert work.shot is not None
    present = {appearance.person for appearance in work.shot.people}
    people = tuple(replace(person, area=0.0) for person in shots.people if person.person in present)
    return replace(shots, shots=(work.shot,), people=people)
