"""Jump cuts that neither pictures nor people show by themselves: time is left out, and somebody leaps a little.

A frame at which the picture changes more than at any around it is no cut yet, and neither is a person whose keypoints
are a little off where they were going: both happen every second. They seldom happen together. What the pictures say
(`Change.outstanding`) and by how much somebody leaps there, compared with how far he is from where he was going at the
frames around it, are multiplied, unless somebody else who moves goes on as before. Under a camera that moves pictures
say little; then everybody must leap, and somebody who is certainly a person farther.

A leap is what lies between the two places, half-way between two sightings, that the two before and the two after lead
to: whoever runs, or is filmed by a camera that turns, does not leap. A camera that is knocked carries everybody and the
place along; a leap counts from whichever of place and picture leaves less of it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from humanmm.models.records.landmarks import INDEX, LIMBS, SWAP
from humanmm.models.records.shots import Change, Scenes
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.shot_detection.sightings import USUAL_S, VISIBLE, Sightings

Array = np.ndarray

CERTAIN, SUSPECTED = 3.0, 2.5
"""Least product of both for a cut, and for a warning: of 11,000 frames of real and rendered clips in which nothing is
left out none has it (docs/measurements/cuts.md)."""
QUIET = 0.6
"""What the pictures say where they say nothing."""
PERSON, SURE = 0.5, 0.9
"""Least probability of somebody who counts, and of somebody who counts where the pictures say nothing."""
LEAST = 1.5
"""Somebody must leap by so much, compared with how far off he is around: a knock changes the whole picture."""
MOVING, GOES_ON = 0.3, 2.0
"""Whoever moves by so many sizes of his body a second, and is less than so many times as far as usual (median) from
where he was going, proves that no time is left out."""
NOISE = 0.01
"""Least distance, fraction of the body's size, by which somebody is usually off: the detector's jitter."""
AROUND, FEWEST = 11, 4
"""Steps on either side that tell what is usual, without the one beside; at least so many must be known."""
GAP_S = 0.15
"""Longest time between two sightings that are neighbours, unless frames are as far apart."""
FEWEST_JOINTS = 5
JOINTS = np.array([INDEX["nose"], *LIMBS])
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
    """The frames, in order, at which somebody leaps and the picture does not speak against it: cuts, and those that are
    suspected.

    `time_s` holds the presentation times of all frames.
    """
    changes = {change.frame: change for change in scenes.changes}
    for scene in people:
        if scene is None:
            continue
        seen = [Sightings(track, time_s) for track in scene.tracks if track.probability >= PERSON]
        walks = [_Walk(person, time_s) for person in seen if len(person.frames) > 3]
        frames = {frame for frame in changes if scene.start < frame < scene.end}
        for frame in sorted(frames.union(*(walk.far_leaps for walk in walks))):
            leap = _leap_at(frame, changes.get(frame), walks)
            if leap is not None:
                yield leap


def _leap_at(frame: int, change: Change | None, walks: Sequence["_Walk"]) -> Leap | None:
    """None where all together is no suspicion."""
    outstanding, step = (QUIET, None) if change is None else (change.outstanding, np.array(change.step))
    farthest = 0.0
    for walk in walks:
        row = int(np.searchsorted(walk.person.frames, frame))
        if not walk.is_known(row):
            continue
        off = walk.off(row, step)
        times = off / float(walk.most_around[row])
        if walk.goes_on(row, off) or (change is None and times < LEAST):
            return None
        if change is not None or walk.person.probability >= SURE:
            farthest = max(farthest, times)
    strength = farthest * outstanding
    return Leap(frame, strength) if farthest >= LEAST and strength >= SUSPECTED else None


class _Walk:
    """How far somebody is off at each of his sightings: from where he was going, fraction of his body's size."""

    def __init__(self, person: Sightings, time_s: Float[Array, " F"]) -> None:
        self.person = person
        rows = [person.row[int(frame)] for frame in person.frames]
        points, self._size, at_s = person.keypoints[rows], person.size[rows], time_s[person.frames]
        # a detector that mistakes left for right from a frame on makes nobody leap
        self._as_named = _Steps(points, points, at_s)
        self._swapped = _Steps(points, points[:, SWAP], at_s)
        self._off = self._distances(np.zeros(2))
        gaps = np.pad(np.diff(at_s), (2, 1), constant_values=np.inf)
        longest_s = np.max([gaps[:-2], gaps[1:-1], gaps[2:]], axis=0)
        self._off[longest_s > max(GAP_S, 1.5 * person.frame_s)] = np.nan
        padded = np.pad(self._off, AROUND, constant_values=np.nan)
        offsets = [k for k in range(-AROUND, AROUND + 1) if abs(k) > 1]
        self._around = np.stack([padded[AROUND + k : AROUND + k + len(rows)] for k in offsets])
        self.most_around = np.maximum(NOISE, np.fmax.reduce(self._around, axis=0, initial=0.0))
        """(N,) the farthest that he is off at the sightings around each of his."""

    @property
    def far_leaps(self) -> set[int]:
        """Frames at which he leaps so far that the pictures need not say anything, and before and after which he is
        seen as well."""
        if self.person.probability < SURE:
            return set()
        far = np.flatnonzero(QUIET * self._off >= SUSPECTED * self.most_around)
        known = (int(row) for row in far if np.isfinite(self._off[row - 1 : row + 2]).all())
        return {int(self.person.frames[row]) for row in known if self.is_known(row)}

    def is_known(self, row: int) -> bool:
        """Whether enough is seen of him at a row of his sightings (one past the last: no) and around it."""
        if not 2 <= row < len(self._off) or np.isnan(self._off[row]):
            return False
        return bool(np.isfinite(self._around[:, row]).sum() >= FEWEST)

    def off(self, row: int, step_px: Float[Array, "2"] | None) -> float:
        """How far he is off at a row; of the picture, or of the place that moves by a step, the smaller one."""
        of_picture = float(self._off[row])
        return of_picture if step_px is None else min(of_picture, float(self._distances(step_px)[row]))

    def goes_on(self, row: int, off: float) -> bool:
        """Whether he moves around a row, and is no farther off there than usual."""
        if off >= GOES_ON * max(NOISE, float(np.nanmedian(self._around[:, row]))):
            return False
        sides = (row - 1, -USUAL_S), (row, USUAL_S)
        speeds = [self.person.usual_speed(int(self.person.frames[at]), within_s) for at, within_s in sides]
        return max((speed for speed in speeds if speed is not None), default=0.0) >= MOVING

    def _distances(self, step_px: Float[Array, "2"]) -> Float[Array, " N"]:
        """(N,) mean distance of the joints beyond a step in common, NaN where too few are seen; of both ways to name
        left and right the smaller one."""
        off = np.fmin(self._as_named.mean_px(step_px), self._swapped.mean_px(step_px))
        size = np.mean([self._size[k : len(off) + k] for k in range(4)], axis=0)
        return np.pad(off / size, (2, 1), constant_values=np.nan)


class _Steps:
    """What lies, between every two neighbours of N sightings, between where the two before and the two after lead."""

    def __init__(self, before: Float[Array, "N K 3"], after: Float[Array, "N K 3"], at_s: Float[Array, " N"]) -> None:
        count = max(0, len(at_s) - 3)
        first, second = (before[k : count + k, JOINTS] for k in (0, 1))
        third, fourth = (after[k : count + k, JOINTS] for k in (2, 3))
        t = [at_s[k : count + k, None, None] for k in range(4)]
        half_s = (t[2] - t[1]) / 2
        ahead = second + (second - first) * half_s / (t[1] - t[0])
        back = third - (fourth - third) * half_s / (t[3] - t[2])
        self._px = (back - ahead)[..., :2]
        self._seen = np.min([one[..., 2] for one in (first, second, third, fourth)], axis=0) > VISIBLE

    def mean_px(self, step_px: Float[Array, "2"]) -> Float[Array, " N"]:
        """Mean length over the joints that are seen, less a step; NaN where they are few."""
        length, seen = np.linalg.norm(self._px - step_px, axis=-1), self._seen.sum(axis=1)
        mean = (length * self._seen).sum(axis=1) / np.maximum(seen, 1)
        return np.where(seen >= FEWEST_JOINTS, mean, np.nan)
