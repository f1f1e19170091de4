"""Who is overlooked: people whom the detector sees again and again, and whom no track follows.

Close-ups of which the shoulders are hardly seen, people far away, more people than are to be followed, also of those
that another program found. Nothing is recovered of them, but that they are there is known, and said.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from humanmm.models.geometry.boxes import box_iou
from humanmm.models.perception.interfaces import Detection
from humanmm.models.perception.observation import Observation
from humanmm.models.perception.tracking.search import lies_on
from humanmm.models.records.shots import Unfollowed
from humanmm.models.video.frame_times import elapsed_s

LEAST_SCORE = 0.2
"""Of a detection that counts."""
COVERED = 0.3
"""Overlap (IoU) with the box of somebody who is followed from which a detection may be his."""
SAME_PLACE = 0.3
"""Overlap (IoU) of two detections, one search after the other, of one person."""
GONE_S = 0.8
"""So long nobody is seen there before he counts as gone: two searches."""
LEAST_S, LEAST_SEARCHES = 1.0, 3
"""So long, and so often, somebody is seen before he is said to be overlooked."""


def followed(frames: Sequence[Int[np.ndarray, "_"]], weight: Sequence[float], max_people: int) -> list[int]:
    """Who of those that another program found is followed, `max_people` at a time: heaviest first.

    `frames` holds for each of them those in which he is seen.
    """
    crowd: Counter[int] = Counter()
    kept = []
    for number in np.argsort(-np.array(weight), kind="stable").tolist():
        own = frames[number].tolist()
        if all(crowd[frame] < max_people for frame in own):
            crowd.update(own)
            kept.append(number)
    return kept


def crowded_out(frame: Int[np.ndarray, " n"], box: Float[np.ndarray, "n 4"], score: float) -> Unfollowed:
    """Somebody whom another program found, beside as many as may be followed."""
    x0, y0, x1, y1 = box[(box[:, 2:] - box[:, :2]).prod(axis=1).argmax()].tolist()
    return Unfollowed(int(frame[0]), int(frame[-1]), (x0, y0, x1, y1), score, crowded=True)


@dataclass
class _Sightings:
    frames: list[int]
    found: list[Detection]
    crowded: list[bool]


class Overlooked:
    """Takes every search's detections, and who is followed then."""

    def __init__(self, time_s: Float[np.ndarray, " F"], max_people: int) -> None:
        self._time_s = time_s
        self._max_people = max_people
        self._people: list[_Sightings] = []

    def note(self, frame: int, detected: Sequence[Detection], followed: Sequence[Observation]) -> None:
        """One search: its detections, and all observations of its frame."""
        crowded = len(followed) >= self._max_people
        for one in detected:
            if one.score < LEAST_SCORE or any(
                lies_on(seen, one) or float(box_iou(seen.bbox[None], one.box)[0]) > COVERED for seen in followed
            ):
                continue
            known = next((person for person in self._people if self._continues(person, frame, one)), None)
            if known is None:
                self._people.append(_Sightings([frame], [one], [crowded]))
            else:
                known.frames.append(frame)
                known.found.append(one)
                known.crowded.append(crowded)

    def finished(self) -> tuple[Unfollowed, ...]:
        """Who was overlooked for long enough, first ones first."""
        return tuple(
            _summed_up(person)
            for person in self._people
            if len(person.frames) >= LEAST_SEARCHES
            and elapsed_s(self._time_s, person.frames[0], person.frames[-1]) >= LEAST_S
        )

    def _continues(self, person: _Sightings, frame: int, one: Detection) -> bool:
        last = person.frames[-1]
        return (
            last < frame
            and elapsed_s(self._time_s, last, frame) <= GONE_S
            and bool(box_iou(person.found[-1].box[None], one.box)[0] > SAME_PLACE)
        )


def _summed_up(person: _Sightings) -> Unfollowed:
    best = max(person.found, key=lambda one: one.score)
    x0, y0, x1, y1 = (float(value) for value in best.box)
    mean = float(np.mean([one.score for one in person.found]))
    crowded = float(np.mean(person.crowded)) > 0.5
    return Unfollowed(person.frames[0], person.frames[-1], (x0, y0, x1, y1), mean, crowded)
