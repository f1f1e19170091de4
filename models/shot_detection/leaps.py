"""Jump cuts that neither pictures nor people show by themselves: time is left out, and somebody leaps a little.

A frame at which the picture changes more than at any around it is no cut yet, and neither is a person whose keypoints
are a little off where they were going: both happen every second. They seldom happen together. What the pictures say
(`Change.outstanding`) and by how much somebody leaps there, compared with how far he is from where he was going at the
frames around it, are multiplied, unless somebody else who moves goes on as before.

A leap is what lies between the two places, half-way between two sightings, that the two before and the two after lead
to: whoever runs, or is filmed by a camera that turns, does not leap. A camera that is knocked carries everybody and the
place along; a leap counts from whichever of place and picture leaves less of it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from humanmm.models.records.landmarks import INDEX, LIMBS, SWAP, VISIBLE
from humanmm.models.records.shots import Scenes
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.shot_detection.sightings import USUAL_S, Sightings, looks_at

Array = np.ndarray

CERTAIN, SUSPECTED = 3.0, 2.5
"""Least product of both for a cut, and for a warning: where nothing is left out none of 11,200 frames of development
has 2.5, and one of 6,800 others has 2.7 (docs/measurements/cuts.md)."""
PERSON = 0.5
"""Least probability of somebody who counts."""
MOVING, GOES_ON = 0.3, 2.0
"""Whoever moves by so many sizes of his body a second, and is less than so many times as far as usual (median) from
where he was going, proves that no time is left out."""
LEAST = 1.5
"""Somebody must leap by so much, compared with how far off he is around: a knock changes the whole picture."""
NOISE = 0.01
"""Least distance, fraction of the body's size, by which somebody is usually off: the detector's jitter."""
AROUND, FEWEST = 11, 4
"""Steps on either side that tell what is usual; at least so many of both sides together must be known."""
GAP_S = 0.15
"""Longest time between two sightings that are neighbours, unless looks are as far apart."""
FEWEST_JOINTS = 5
JOINTS = (INDEX["nose"], *LIMBS)
"""The joints that are compared."""


@dataclass(frozen=True)
class Leap:
    """A frame before which time may have been left out."""

    frame: int
    strength: float
    """How much more than around it the picture changes, times how much more than around it somebody leaps."""

    @property
    def certain(self) -> bool:
        """Whether it is a jump cut."""
        return self.strength >= CERTAIN


def leaps(scenes: Scenes, people: Sequence[ScenePeople | None], *, time_s: Float[Array, " F"]) -> Iterator[Leap]:
    """The frames, in order, at which people leap while the picture changes: cuts, and those that are suspected.

    `time_s` holds the presentation times of all frames.
    """
    for scene in people:
        if scene is None:
            continue
        looks = looks_at(scene, len(time_s))
        look_s = time_s[looks]
        seen = [Sightings(track, looks, look_s) for track in scene.tracks if track.probability >= PERSON]
        for change in scenes.changes:
            if scene.start < change.frame < scene.end:
                look, step_px = int(np.searchsorted(looks, change.frame)), np.array(change.step)
                said = [one for person in seen if (one := _testimony(person, look, step_px, look_s)) is not None]
                farthest = max((one.times_largest for one in said), default=0.0)
                strength = farthest * change.outstanding
                if farthest >= LEAST and strength >= SUSPECTED and not any(one.goes_on for one in said):
                    yield Leap(change.frame, strength)


class _Testimony(NamedTuple):
    """What one person says of a look."""

    times_largest: float
    """How far he is from where he was going: compared with the farthest that he is around it."""
    goes_on: bool
    """Whether he moves, and goes on doing so."""


def _testimony(
    person: Sightings, look: int, step_px: Float[Array, "2"], look_s: Float[Array, " L"]
) -> _Testimony | None:
    """Of the step before a look, in which the place moves by `step_px`. None where too little of him is seen."""
    row = int(np.searchsorted(person.looks, look))
    here = _leap(person, row, look_s, step_px)
    if here is None:
        return None
    around = [_leap(person, other, look_s) for k in range(2, AROUND + 1) for other in (row - k, row + k)]
    usual = [one for one in around if one is not None]
    if len(usual) < FEWEST:
        return None
    as_usual = here < GOES_ON * max(NOISE, float(np.median(usual)))
    return _Testimony(here / max(NOISE, *usual), as_usual and _moves(person, row))


def _moves(person: Sightings, row: int) -> bool:
    """Whether somebody moves before a row of his sightings, or from it on."""
    sides = (row - 1, -USUAL_S), (row, USUAL_S)
    speeds = [person.usual_speed(int(person.looks[at]), within_s) for at, within_s in sides]
    return any(speed is not None and speed >= MOVING for speed in speeds)


def _leap(
    person: Sightings, row: int, look_s: Float[Array, " L"], step_px: Float[Array, "2"] | None = None
) -> float | None:
    """How far somebody leaps before a row of his sightings, fraction of the body's size; None where too little of him
    is seen, or too seldom. `step_px`: that of the place, or the picture's frame where nothing of it is known."""
    if not 2 <= row <= len(person.looks) - 2:
        return None
    looks = person.looks[row - 2 : row + 2]
    if np.diff(look_s[looks]).max() > max(GAP_S, 1.5 * person.step_s):
        return None
    rows = [person.row[int(look)] for look in looks]
    points = person.keypoints[rows]
    # a detector that mistakes left for right from here on makes nobody leap
    swapped = np.concatenate([points[:2], points[2:, SWAP]])
    steps = [np.zeros(2)] if step_px is None else [np.zeros(2), step_px]
    found = [_mean_step(one[:, JOINTS], look_s[looks], step) for one in (points, swapped) for step in steps]
    distances = [distance for distance in found if distance is not None]
    return min(distances) / float(person.size[rows].mean()) if distances else None


def _mean_step(points: Float[Array, "4 J 3"], at_s: Float[Array, "4"], step_px: Float[Array, "2"]) -> float | None:
    """Mean distance, in pixels, of the joints between where the first two sightings and the last two lead to, half-way
    between them, beyond a step that they have in common."""
    visible = points[..., 2].min(axis=0) > VISIBLE
    if visible.sum() < FEWEST_JOINTS:
        return None
    first, second, third, fourth = points[:, visible, :2]
    half_s = (at_s[2] - at_s[1]) / 2
    before = second + (second - first) * half_s / (at_s[1] - at_s[0])
    after = third - (fourth - third) * half_s / (at_s[3] - at_s[2])
    return float(np.linalg.norm(after - before - step_px, axis=-1).mean())
