"""The worlds of a recording (`motion.refine.worlds`): whom each holds, and where it stands in a picture.

Every world has its own first person above its own origin, so that all lie on top of one another in the numbers of a
recording; the page sets them apart along x, and the picture from above gives each axes of its own.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from humanmm.models.motion.refine.worlds import most_seen
from humanmm.models.records.recording import RecordedPerson, Recording

_APART_M = 3.0
"""Room between worlds in a picture."""
_NEAR_M = 12.0
"""A camera farther from its people than this makes no more room for its world."""


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


def world_of_person(recording: Recording, person: RecordedPerson) -> int:
    """The world in which he was observed most."""
    return most_seen(world_of_each_frame(recording), person.frame, person.observed)


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
