"""Who is who across cuts, compared with who it is: cut pairs, the links that are made of them, and how sure they are.

A cut pair is what one shot shows and what a next one shows. Some are of one recording: cuts of a clip, another camera,
or the same one half a second later. As many as there are shots have one of an unrelated recording after the cut.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from humanmm.models.geometry.boxes import box_iou
from humanmm.models.geometry.intervals import in_intervals
from humanmm.models.records.shots import Shot
from humanmm.models.records.tracks import PersonTrack, ScenePeople
from humanmm.models.shots.identity import Sighting, answers_of, match, sighting

Array = np.ndarray

PIECE_S, GAP_S = 1.5, 0.5
"""A recording without cuts is divided into pieces of this length, this far apart."""
LONG_S = 2.0
"""Shots longer than this are divided."""
LEAST_IOU = 0.3
LEAST_SHARE, CLEAR_SHARE = 0.2, 0.7
"""Of a track's frames, how many must lie on somebody for it to be his: less than the first, it is nobody's; more than
the second, his; else it is left out."""

Boxes = Mapping[str, Float[Array, "frames 4"]]
"""Of everybody in a clip, by name: his box in every frame of it, source pixels, NaN where he is not in view."""


@dataclass(frozen=True)
class Seen:
    """One track in a shot."""

    sighting: Sighting
    who: str | None
    """Recording and name; None for nobody: a picture of a person, a bag, somebody of a crowd."""


@dataclass(frozen=True)
class View:
    """Everybody who is seen in a shot, or in a piece of one."""

    recording: str
    """Views of different recordings show different people."""
    people: tuple[Seen, ...]


@dataclass(frozen=True)
class CutPair:
    """What two shots show."""

    before: View
    after: View

    @property
    def unrelated(self) -> bool:
        """Whether they are of different recordings."""
        return self.before.recording != self.after.recording


@dataclass(frozen=True)
class Link:
    """Two tracks that are said to be one person."""

    probability: float
    right: bool


@dataclass(frozen=True)
class PairFigures:
    """One cut pair: links that are there, and those that were made (of nobody and nobody, nothing is known)."""

    unrelated: bool
    true: int
    made: tuple[Link, ...]


def views_of(
    recording: str,
    shots: Sequence[Shot],
    scenes: Sequence[ScenePeople],
    boxes: Boxes,
    time_s: Float[Array, " F"],
) -> list[View]:
    """The views of a clip: its shots, divided where they are long."""
    views = []
    for shot in shots:
        for span in _pieces(*shot.outside_transitions, time_s):
            piece = replace(shot, start=span[0], end=span[1], transition=None, ending=None)
            people = []
            for number, track in enumerate(scenes[shot.scene].tracks):
                seen = sighting(shot.index, piece, number, track, time_s)
                who = _owner(track, span, boxes)
                if seen is not None and who != _UNCLEAR:
                    people.append(Seen(seen, who and f"{recording}/{who}"))
            if people:
                views.append(View(recording, tuple(people)))
    return views


def cut_pairs(views: Sequence[View]) -> list[CutPair]:
    """Every two views in a row of one recording, and every view with one of another recording, taken in turn."""
    related = [CutPair(a, b) for a, b in pairwise(views) if a.recording == b.recording]
    unrelated = []
    for k, view in enumerate(views):
        others = [other for other in [*views[k:], *views[:k]] if other.recording != view.recording]
        if others:
            unrelated.append(CutPair(view, others[7 * k % len(others)]))
    return related + unrelated


def linked(pair: CutPair) -> PairFigures:
    """What the matching of identities makes of a cut pair."""
    before = [[replace(one.sighting, shot=0)] for one in pair.before.people]
    after = [replace(one.sighting, shot=1) for one in pair.after.people]
    answers = match(before, after)
    sure = answers_of(dict(enumerate(before)), {known: after[new] for known, new in answers.items()})
    made = []
    for known, new in answers.items():
        if known >= len(before):
            continue
        a, b = pair.before.people[known].who, pair.after.people[new].who
        if a is not None or b is not None:
            made.append(Link(sure[known].probability, a == b))
    there = [{one.who for one in view.people} - {None} for view in (pair.before, pair.after)]
    return PairFigures(pair.unrelated, len(there[0] & there[1]), tuple(made))


_UNCLEAR = "?"


def _owner(track: PersonTrack, span: tuple[int, int], boxes: Boxes) -> str | None:
    """On whom a track lies in the frames of a span; None for nobody, _UNCLEAR where that cannot be said."""
    inside = in_intervals(track.frame, [span])
    if not inside.any() or not boxes:
        return None
    seen, frame = track.bbox[inside].astype(np.float64), track.frame[inside]
    overlap = np.array([np.nan_to_num(box_iou(seen, box[frame])) for box in boxes.values()])
    found = overlap.max(axis=0) > LEAST_IOU
    if found.mean() < LEAST_SHARE:
        return None
    counts = np.bincount(overlap.argmax(axis=0)[found], minlength=len(boxes))
    return list(boxes)[counts.argmax()] if counts.max() >= CLEAR_SHARE * len(found) else _UNCLEAR


def _pieces(start: int, end: int, time_s: Float[Array, " F"]) -> list[tuple[int, int]]:
    """[start, end) in pieces that are apart; whole if it is short."""
    if start >= end or time_s[end - 1] - time_s[start] < LONG_S:
        return [(start, end)]
    found = []
    begin = time_s[start]
    while begin + PIECE_S / 2 < time_s[end - 1]:
        piece = np.flatnonzero((time_s[start:end] >= begin) & (time_s[start:end] < begin + PIECE_S)) + start
        if len(piece):
            found.append((int(piece[0]), int(piece[-1]) + 1))
        begin += PIECE_S + GAP_S
    return found
