"""Worlds of a video: the groups of shots that people or backgrounds join. Positions in two worlds cannot be compared.

Each has a floor and an origin of its own: its people and cameras move together, apart from those of other worlds.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from humanmm.models.records.motion import WorldMotion
from humanmm.models.records.shots import ShotList

Array = np.ndarray


@dataclass(frozen=True)
class JoinedShot:
    """What a shot's world follows from."""

    linked: bool
    """Whether anything joins it to the other shots."""
    earlier: tuple[int, ...]
    """Earlier shots that evidence in use joins it to."""
    people: frozenset[int]


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


def most_seen(world_of_frame: Int[Array, " F"], frame: Int[Array, " N"], observed: Bool[Array, " N"]) -> int:
    """The world in which a person was observed most; if nowhere, in which most of his frames are; 0 without any."""
    seen = world_of_frame[frame[observed] if observed.any() else frame]
    return int(np.bincount(seen, minlength=1).argmax())


@dataclass(frozen=True, eq=False)
class WorldMembers:
    """Who and what moves with which world."""

    of_frame: Int[Array, " F"]
    """World of the camera. Frames of shots without people count to that of the nearest frame of others: failed shots
    have its camera (`align`)."""
    of_person: Mapping[int, int]
    """Person → world."""

    def each_frame(self, of_world: Mapping[int, Float[Array, "3"]]) -> Float[Array, "F 3"]:
        """What is given for each world with people, for each frame."""
        return np.array([of_world[int(world)] for world in self.of_frame]).reshape(-1, 3)


def members_of(motion: WorldMotion, shot_list: ShotList | None) -> WorldMembers:
    """Those of an aligned video with people; without shots all is one world."""
    of_frame = np.zeros(len(motion.t_world_cam), np.int64)
    worlds = worlds_of_motion(shot_list, motion) if shot_list is not None else ()
    if worlds and shot_list is not None:
        of_frame = np.repeat(worlds, [shot.end - shot.start for shot in shot_list.shots])
    of_person = {one.person: most_seen(of_frame, one.frame, one.observed) for one in motion.people}
    known = np.flatnonzero(np.isin(of_frame, list(of_person.values())))
    nearest = np.rint(np.interp(np.arange(len(of_frame)), known, np.arange(len(known)))).astype(np.int64)
    return WorldMembers(of_frame[known[nearest]], of_person)
