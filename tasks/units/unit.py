"""The units that a video falls into: one stage on the whole video, on one scene, or on one shot."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from humanmm.models.records.shots import Scenes, Shot, ShotList
from humanmm.storage.store.codec import Json
from humanmm.tasks.pipeline import Stage

UnitId = tuple[str, int]
"""Name of the stage, number of the scene or shot."""


@dataclass(frozen=True)
class Unit:
    """One stage × video, scene or shot."""

    stage: Stage
    index: int = 0
    """Number of the scene or shot; 0 for the video."""
    span: tuple[int, int] = (0, 0)
    """Frames [start, end); (0, 0) for the whole video."""
    scene: int = 0
    """Number of the scene that holds it."""
    shot: Shot | None = None
    """What a stage per shot knows of its shot."""

    @property
    def id(self) -> UnitId:
        return self.stage.name, self.index

    @property
    def name(self) -> str:
        """`video`, `scene 2` or `shot 3`, as people read it."""
        return "video" if self.stage.per == "video" else f"{self.stage.per} {self.index}"

    @property
    def label(self) -> str:
        """Name of the task: `align`, `camera · shot 3`."""
        return self.stage.name if self.stage.per == "video" else f"{self.stage.name} · {self.name}"

    @property
    def record(self) -> str:
        """Name under which the store keeps its last recipe: by frames, so that a new cut renames no other unit."""
        return "video" if self.stage.per == "video" else f"{self.stage.per}-{self.span[0]}-{self.span[1]}"

    @property
    def parameters(self) -> dict[str, Json]:
        """Its part of the key. The rest of a shot stands in the digest of its own part of the shot list."""
        return {} if self.stage.per == "video" else {"start": self.span[0], "end": self.span[1]}


def units_of(stage: Stage, scenes: Scenes | None, shots: ShotList | None) -> tuple[Unit, ...] | None:
    """All units of a stage in order; None as long as the artifact that defines them is missing."""
    if stage.per == "video":
        return (Unit(stage),)
    if stage.per == "scene":
        return None if scenes is None else tuple(Unit(stage, i, span, i) for i, span in enumerate(scenes.spans))
    if shots is None:
        return None
    return tuple(
        Unit(stage, shot.index, (shot.start, shot.end), shot.scene, replace(shot, index=0, scene=0))
        for shot in shots.shots
    )


def read_by(unit: Unit, source: Stage, units: Sequence[Unit]) -> Sequence[Unit]:
    """Those of all units of an input stage that a unit reads."""
    if "video" in (unit.stage.per, source.per):
        return units
    if source.per == unit.stage.per:
        return (units[unit.index],)
    if source.per == "scene":
        return (units[unit.scene],)
    raise ValueError(f"{unit.stage.name} is per {unit.stage.per} and cannot read {source.name}, which is per shot")


def seen_shot_list(shots: ShotList, unit: Unit) -> ShotList:
    """The list of shots as a unit sees it, without what became of corrections.

    A stage per shot sees its shot alone, as number 0, and the people in it without their video-wide area; a stage that
    does not see people finds nobody.
    """
    shots = replace(shots, corrections=())
    if unit.stage.per == "shot":
        assert unit.shot is not None
        present = {appearance.person for appearance in unit.shot.people}
        people = tuple(replace(person, area=0.0) for person in shots.people if person.person in present)
        shots = replace(shots, shots=(unit.shot,), people=people)
    if unit.stage.sees_people_of_shots:
        return shots
    empty = tuple(replace(shot, people=()) for shot in shots.shots)
    return replace(shots, shots=empty, people=(), warnings=())
