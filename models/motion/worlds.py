"""Worlds of a video: the groups of shots that people or backgrounds join. Positions in two worlds cannot be compared.

Every world has its own first person above its own origin, so that all lie on top of one another in the numbers of a
recording; the page sets them apart along x, and the picture from above gives each axes of its own.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from humanmm.models.records.motion import WorldMotion
from humanmm.models.records.recording import RecordedPerson, Recording
from humanmm.models.records.shots import ShotList

_APART_M = 3.0
"""Room between worlds in a picture."""
_NEAR_M = 12.0
"""A camera farther from its people than this makes no more room for its world."""


@dataclass(frozen=True)
class JoinedShot:
    """What a shot's world follows from."""

    linked: bool
    """Whether anything joins it to the other shots."""
    earlier: tuple[int, ...]
    """Earlier shots that evidence in use joins it to."""
    people: frozenset[int]


@dataclass(frozen=True, eq=False)
class WorldPlace:
    """Where a world stands in a picture of all of them."""

    shots: tuple[int, ...]
    center: Float[np.ndarray, "2"]
    """Middle of its people and cameras on the floor, in its own numbers, metres."""
    offset_m: float
    """Along x; that of the first world is 0."""

    @property
    def title(self) -> str:
        return title_of_shots(self.shots)


def title_of_shots(shots: Sequence[int]) -> str:
    """In words."""
    return f"shot{'s' * (len(shots) > 1)} {', '.join(map(str, shots))}"


def worlds_of(shots: Iterable[JoinedShot]) -> tuple[int, ...]:
    """The world of every shot, counted from 0.

    A shot that nothing links begins a world; one that is linked is in that of the earlier shot that its evidence names,
    else of the last one with which it shares people, else of the one before it.
    """
    worlds: list[int] = []
    seen: list[frozenset[int]] = []
    for index, shot in enumerate(shots):
        if index == 0 or not shot.linked:
            worlds.append(max(worlds, default=-1) + 1)
        else:
            earlier = [*shot.earlier, *(other for other in reversed(range(index)) if shot.people & seen[other])]
            worlds.append(worlds[earlier[0] if earlier else index - 1])
        seen.append(shot.people)
    return tuple(worlds)


def worlds_of_motion(shot_list: ShotList, motion: WorldMotion) -> tuple[int, ...]:
    """The world of every shot of an aligned video; empty where all are one."""
    linked = {cut.cut_frame: cut.linked for cut in motion.cuts}
    worlds = worlds_of(
        JoinedShot(
            linked=linked.get(shot.start, True),
            earlier=tuple(one.shot_a for one in motion.evidence if one.used and one.shot_a < one.shot_b == shot.index),
            people=frozenset(appearance.person for appearance in shot.people),
        )
        for shot in shot_list.shots
    )
    return worlds if any(worlds) else ()


def world_of_person(recording: Recording, person: RecordedPerson) -> int:
    """The world in which he was observed most."""
    seen = person.frame[person.observed] if person.observed.any() else person.frame
    return int(np.bincount(world_of_each_frame(recording)[seen], minlength=1).argmax())


def world_of_each_frame(recording: Recording) -> np.ndarray:
    """(F,) int64."""
    if not recording.worlds:
        return np.zeros(recording.num_frames, np.int64)
    return np.asarray(np.array(recording.worlds, np.int64)[recording.shot_index])


def world_places(recording: Recording, worlds: Sequence[int]) -> tuple[WorldPlace, ...]:
    """Worlds side by side along x. `worlds`: that of every shot."""
    places: list[WorldPlace] = []
    edge = 0.0
    for world in range(max(worlds) + 1):
        shots = tuple(shot for shot, other in enumerate(worlds) if other == world)
        points = _points(recording, np.flatnonzero(np.isin(recording.shot_index, shots)))
        low, high = points.min(axis=0), points.max(axis=0)
        offset = 0.0 if world == 0 else edge + _APART_M - float(low[0])
        edge = float(high[0]) + offset
        places.append(WorldPlace(shots, (low + high) / 2, offset))
    return tuple(places)


def _points(recording: Recording, frames: np.ndarray) -> Float[np.ndarray, "n 2"]:
    """Where people and cameras are on the floor in some frames."""
    inside = [person.pelvis[np.isin(person.frame, frames) & person.observed, :2] for person in recording.people]
    people = np.concatenate([*inside, np.zeros((0, 2))])
    cameras = recording.t_world_cam[frames, :2]
    middle = people.mean(axis=0) if len(people) else cameras.mean(axis=0)
    cameras = cameras[np.linalg.norm(cameras - middle, axis=1) < _NEAR_M]
    return np.concatenate([people, cameras, middle[None]]).astype(np.float64)
