"""Everybody in one scene where another program found him: our pose network looks at the people in given boxes or masks.

Nobody else is looked for. Whoever has a number keeps it; boxes without numbers are one person's where they overlap from
picture to picture. Between two boxes of one person that are not far apart in time he is looked for on a straight line
from one to the other. Whoever is in front of somebody is painted out, for two in one crop look like one body: the given
masks say where he is, else what was seen of him. A given mask takes the place of the pose network's own.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8
from scipy.optimize import linear_sum_assignment

from humanmm.models.geometry.boxes import box_iou
from humanmm.models.perception.hands.follow import due_frames
from humanmm.models.perception.interfaces import Landmarks, Networks
from humanmm.models.perception.observation import Observation, observe
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import HEIGHT_OF_SIDE, Region, warp
from humanmm.models.perception.tracking.overlooked import crowded_out, followed
from humanmm.models.perception.tracking.painting import GRAY, covered_fraction, without
from humanmm.models.perception.tracking.search import MAX_COVERED, same_person
from humanmm.models.perception.tracking.track_builder import TrackBuilder, largest_first, shortest_track_s
from humanmm.models.perception.tracking.tracker import in_source_pixels
from humanmm.models.records.tracks import MASK_SIDE, ScenePeople
from humanmm.models.video.frame_times import ROUNDING_S, elapsed_s, shown_s

Array = np.ndarray

LOST_S = 1.0
"""A box without a number goes on in a track that ended no longer ago."""
FILLED_S = 0.5
"""Between boxes of one person that are no further apart he is looked for: half of LOST_S, for a straight line must lead
to where he was, and the pose network must see him there."""
SPARSE_S = 0.1
"""People whose boxes are further apart (median) have a warning: the quickest setting of our own looks every 1/15 s."""
SAME_BOX = 0.3
"""Overlap of boxes from which they are one person's in successive pictures."""
SAME_BODY = 0.2
"""Overlap with the given box below which the pose network looked at somebody else."""
IN_THE_WAY = 0.1
"""Overlap of boxes from which one person may hide another."""


@dataclass(frozen=True, eq=False)
class GivenRegions:
    """People's boxes in pictures, one a row."""

    frame: Int[Array, " M"]
    """Not decreasing."""
    person: Int[Array, " M"]
    """Whose it is; −1 where nobody said."""
    box: Float[Array, "M 4"]
    """xyxy, pixels of the video."""
    score: Float[Array, " M"]
    """0..1."""
    labels: Callable[[int], Array | None] | None = None
    """The picture of a frame's masks (height, width), a pixel's value is `person`; may be smaller than the video's.
    None where no masks are given for a frame."""
    warnings: tuple[str, ...] = ()
    """What is odd about them, one sentence each."""
    lasting: bool = False
    """`person` is the same one's through the whole video, not only within a scene."""


def track_regions(
    pictures: Iterable[tuple[int, Picture]],
    given: GivenRegions,
    *,
    span: tuple[int, int],
    time_s: Float[Array, " F"],
    size: tuple[int, int],
    max_people: int,
    networks: Networks,
    hands: bool = False,
) -> ScenePeople:
    """The tracks of one scene's frames, largest first; of more than `max_people` at a time those in the largest boxes.

    `time_s` holds the presentation times of all frames of the video; pictures may be smaller than `size`. With `hands`
    the people's hands are looked at as well.
    """
    start, end = span
    rows = np.arange(*np.searchsorted(given.frame, span))
    given, owner = _filled(given, rows, _owners(given, rows, time_s), time_s)
    rows = np.arange(len(owner))
    areas = (given.box[rows, 2:] - given.box[rows, :2]).prod(axis=1)
    total = np.bincount(owner, weights=areas) if len(rows) else np.zeros(0)
    rows_of = [rows[owner == person] for person in range(len(total))]
    kept = followed([given.frame[own] for own in rows_of], total.tolist(), max_people)
    builders: dict[int, TrackBuilder] = {}
    hands_due = due_frames(time_s[:end]) if hands else None
    scale = np.ones(2)
    for frame, image in pictures:
        scale = np.array(size) / image.size
        here = _Frame(frame, image, given, rows[given.frame[rows] == frame], scale)
        for row in here.nearest_first():
            person = int(owner[row])
            seen = _look(here, row, builders.get(person), networks) if person in kept else None
            if seen is not None:
                _add(builders, person, frame, image, seen, time_s)
                builders[person].detector_scores[frame] = float(given.score[row])
                builders[person].look_at_hands(frame, image, hands_due)
    shortest_s = shortest_track_s(time_s, span)
    lasting = [int(given.person[own[0]]) if given.lasting else -1 for own in rows_of]
    tracks = largest_first(
        replace(one.finished(), number=lasting[person]) for person, one in builders.items() if one.seen_s >= shortest_s
    )
    others = tuple(
        crowded_out(given.frame[own], given.box[own] / np.tile(scale, 2), float(given.score[own].mean()))
        for person, own in enumerate(rows_of)
        if person not in kept and float(shown_s(time_s, given.frame[own]).sum()) >= shortest_s
    )
    return in_source_pixels(ScenePeople(start, end, tracks, given.warnings, others), scale)


class _Frame:
    """One picture, the boxes given in it, and who was seen in them so far."""

    def __init__(
        self, frame: int, image: Picture, given: GivenRegions, rows: Int[Array, " n"], scale: Float[Array, " 2"]
    ) -> None:
        self.frame, self.image = frame, image
        self.boxes = dict(zip(rows.tolist(), given.box[rows] / np.tile(scale, 2), strict=True))
        self.labels = None if given.labels is None or not len(rows) else given.labels(frame)
        self.number = dict(zip(rows.tolist(), given.person[rows].tolist(), strict=True))
        self.seen: list[Observation] = []

    def nearest_first(self) -> list[int]:
        """The rows: lowest in the picture first, the others may be hidden behind them."""
        return sorted(self.boxes, key=lambda row: -float(self.boxes[row][3]))

    def without_others(self, row: int, known: TrackBuilder | None) -> tuple[Picture, UInt8[Array, "h w"]] | None:
        """A picture without those who may hide somebody, and 1 where it is painted; None where nobody does."""
        if self.labels is not None:
            others = ((self.labels > 0) & (self.labels != self.number[row])).astype(np.uint8)
            if not others.any():
                return None
            canvas, painted = self.image.copy(), cv2.resize(others, self.image.size, interpolation=cv2.INTER_NEAREST)
            canvas.paint(0, 0, painted, GRAY)
            return canvas, painted
        hiding = [other for other in self.seen if box_iou(self.boxes[row], other.bbox) > IN_THE_WAY]
        spared = None if known is None else known.predicted_keypoints(self.frame)
        return without(self.image, hiding, spared=spared) if hiding else None

    def is_of(self, row: int, seen: Observation) -> bool:
        """True where somebody seen is whoever a given box is about: no other box fits better, and he is nobody who was
        seen in one."""
        overlap = {other: float(box_iou(seen.bbox, box)) for other, box in self.boxes.items()}
        best = overlap[row] >= max(SAME_BODY, *overlap.values())
        return best and not any(same_person(seen, other) for other in self.seen)


def _look(here: _Frame, row: int, known: TrackBuilder | None, networks: Networks) -> Observation | None:
    """Who is in one box, if the pose network sees him there: where his track has him, or all over the box."""
    regions = [_region(here.boxes[row])] if known is None else [known.predicted(here.frame), _region(here.boxes[row])]
    clear = here.without_others(row, known)
    for image, painted in ([] if clear is None else [clear]) + [(here.image, None)]:
        for region in regions:
            output = networks.locate(image, region)
            if output.next_region.outlier_of(region, shift=0.12, ratio=1.3):
                output = networks.locate(image, output.next_region)
            if here.labels is not None:
                output = _with_mask(output, here.labels, here.number[row], image)
            seen = observe(output, image.size)
            if seen is None or not here.is_of(row, seen):
                continue
            if painted is None or covered_fraction(painted, seen) <= MAX_COVERED:
                here.seen.append(seen)
                return seen
    return None


def _add(
    builders: dict[int, TrackBuilder],
    person: int,
    frame: int,
    image: Picture,
    seen: Observation,
    time_s: Float[Array, " F"],
) -> None:
    track = builders.setdefault(person, TrackBuilder(time_s, seen, frame))
    track.add(frame, seen)
    track.note_colours(frame, image)
    track.note_own_motion(frame, image)


def _region(box: Float[Array, " 4"]) -> Region:
    """Where the landmarks of whoever fills a box are looked for first."""
    side = float(max(box[2] - box[0], box[3] - box[1])) / HEIGHT_OF_SIDE
    return Region(float(box[0] + box[2]) / 2, float(box[1] + box[3]) / 2, max(side, 8.0))


def _with_mask(output: Landmarks, labels: Array, person: int, image: Picture) -> Landmarks:
    """The same with the given mask in the crop."""
    scale = np.array([labels.shape[1], labels.shape[0]]) / image.size
    to_labels = output.region.to_source(MASK_SIDE) * scale[:, None]
    mask = warp((labels == person).astype(np.uint8), to_labels, (MASK_SIDE, MASK_SIDE), nearest=True)
    return replace(output, mask=mask * np.uint8(255))


def sparse(frame: Int[Array, " M"], time_s: Float[Array, " F"]) -> tuple[str, ...]:
    """A warning if the frames in which people are given are few; `time_s` holds the times of all frames."""
    given = np.unique(frame)
    if len(given) < 2 or (apart_s := float(np.median(np.diff(time_s[given])))) <= SPARSE_S + ROUNDING_S:
        return ()
    between = (
        "between them people are looked for on a straight line from box to box"
        if apart_s <= FILLED_S
        else "nobody is looked for between them"
    )
    return (
        f"given boxes or masks are on one frame in {np.median(np.diff(given)):.0f} ({apart_s:.2f} s apart): {between}; "
        "give them on more frames",
    )


def _filled(
    given: GivenRegions, rows: Int[Array, " n"], owner: Int[Array, " n"], time_s: Float[Array, " F"]
) -> tuple[GivenRegions, Int[Array, " m"]]:
    """Some rows of the regions, and between two boxes of one owner, up to FILLED_S apart, boxes on a straight line in
    time; and the owner of each."""
    frame, numbers = given.frame[rows], np.column_stack([given.box[rows], given.score[rows]])
    parts = [(frame, given.person[rows], numbers, owner)]
    for one in np.unique(owner):
        own = np.flatnonzero(owner == one)
        known = frame[own]
        between = np.setdiff1d(np.arange(known[0], known[-1]), known)
        after = np.searchsorted(known, between)
        between = between[time_s[known[after]] - time_s[known[after - 1]] <= FILLED_S + ROUNDING_S]
        line = [np.interp(time_s[between], time_s[known], values) for values in numbers[own].T]
        person = given.person[rows[own[0]]]
        parts.append((between, np.full(len(between), person), np.column_stack(line), np.full(len(between), one)))
    frame, who, numbers, owner = (np.concatenate(part) for part in zip(*parts, strict=True))
    order = np.argsort(frame, kind="stable")
    boxes, score = numbers[order, :4], numbers[order, 4]
    return replace(given, frame=frame[order], person=who[order], box=boxes, score=score), owner[order]


def _owners(given: GivenRegions, rows: Int[Array, " n"], time_s: Float[Array, " F"]) -> Int[Array, " n"]:
    """Number of the track that each row belongs to, from 0 on: those of given numbers, then of boxes without one, which
    go on in one another."""
    owner = np.full(len(rows), -1)
    numbered = given.person[rows] >= 0
    numbers, owner[numbered] = np.unique(given.person[rows][numbered], return_inverse=True)
    last: list[int] = []
    for frame in np.unique(given.frame[rows][~numbered]):
        here = np.flatnonzero((given.frame[rows] == frame) & ~numbered)
        near = [k for k, row in enumerate(last) if elapsed_s(time_s, int(given.frame[row]), int(frame)) <= LOST_S]
        overlap = box_iou(given.box[[last[k] for k in near]][:, None], given.box[rows[here]][None])
        for k, column in zip(*linear_sum_assignment(-overlap), strict=True):
            if overlap[k, column] >= SAME_BOX:
                owner[here[column]] = near[k]
        for at in here:
            if owner[at] < 0:
                owner[at] = len(last)
                last.append(int(rows[at]))
            else:
                last[owner[at]] = int(rows[at])
    return np.where(numbered, owner, len(numbers) + owner)
