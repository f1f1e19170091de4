"""What the user says of people: who is one, who is nobody, who was taken for whom, where nothing is to be believed.

People are still unnumbered groups of sightings here. Corrections apply one after the other, in the order of the user;
each finds whom it means by a place in a picture.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from humanmm.corrections import (
    Correction,
    Corrections,
    Exclude,
    Height,
    Main,
    Nobody,
    SamePerson,
    Sides,
    Swap,
    Who,
)
from humanmm.models.records.landmarks import INDEX
from humanmm.models.records.shots import Appearance, CorrectionNote, Shot, TrackPart
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.shots.identity import Candidate, GivenFacts, Sighting, sighting
from humanmm.models.shots.left_right_swaps import NEAR_FRAMES, KnownSides

ON_BOX = 0.65
"""Farthest place that counts as on a person: from the middle of his box, in its widths and heights (0.5: its edge)."""

Parts = tuple[TrackPart, ...]


class _MisfitError(Exception):
    """Why a correction does not fit."""


@dataclass(eq=False)
class _Group:
    """One person while corrections apply."""

    parts: dict[int, Parts]
    """By shot."""
    given: GivenFacts = field(default_factory=GivenFacts)


def corrected_people(
    people: Sequence[Sequence[Sighting]],
    shots: Sequence[Shot],
    scenes: Sequence[ScenePeople | None],
    corrections: Corrections,
    *,
    time_s: Float[np.ndarray, " F"],
) -> tuple[list[Candidate], list[CorrectionNote]]:
    """The people as the user says, and a note for each of the corrections that is about people.

    `people`: the sightings of each (`identity.matched_people`); `scenes`: None where one failed.
    """
    room = _Room(shots, scenes, [_Group({s.shot: (_whole(s, shots),) for s in person}) for person in people])
    notes = [note for one in corrections.correction if (note := room.note(one)) is not None]
    known = {(s.shot, s.track): s for person in people for s in person}
    found = [Candidate(_sightings(group, shots, scenes, known, time_s), group.given) for group in room.groups]
    return [candidate for candidate in found if candidate.sightings], notes


def _whole(one: Sighting, shots: Sequence[Shot]) -> TrackPart:
    return TrackPart(one.track, shots[one.shot].start, shots[one.shot].end)


def _sightings(
    group: _Group,
    shots: Sequence[Shot],
    scenes: Sequence[ScenePeople | None],
    known: Mapping[tuple[int, int], Sighting],
    time_s: Float[np.ndarray, " F"],
) -> tuple[Sighting, ...]:
    """What is left of a person in each shot; a track of which nothing was taken away is as it was."""
    found = []
    for index, parts in sorted(group.parts.items()):
        shot, scene = shots[index], scenes[shots[index].scene]
        if scene is None or not parts:
            continue
        track = parts[0].track
        if parts == (TrackPart(track, shot.start, shot.end),):
            found.append(known[index, track])
            continue
        own = sighting(index, shot, track, scene.track_of(Appearance(0, track, parts=parts)), time_s)
        if own is not None:
            found.append(replace(own, parts=parts))
    return tuple(found)


@dataclass
class _Room:
    """All people, changed by one correction after the other."""

    shots: Sequence[Shot]
    scenes: Sequence[ScenePeople | None]
    groups: list[_Group]

    def note(self, correction: Correction) -> CorrectionNote | None:
        """Apply a correction; what became of it, or None if it is not about people."""
        apply = _APPLY.get(type(correction))
        if apply is None:
            return None
        try:
            return CorrectionNote(correction.identity, True, apply(self, correction))
        except _MisfitError as misfit:
            return CorrectionNote(correction.identity, False, str(misfit))

    # ---- one kind each; the result is a remark, or empty

    def same(self, one: SamePerson) -> str:
        first, second = self.find(one.who), self.find(one.other)
        if first is second:
            return "they are one without the correction, too"
        both = 0
        for index, parts in second.parts.items():
            mine = first.parts.get(index, ())
            first.parts[index], shared = self.joined(index, mine, parts)
            both += shared
        given = first.given
        first.given = GivenFacts(
            given.main or second.given.main, given.height_m or second.given.height_m, given.sides + second.given.sides
        )
        self.groups.remove(second)
        return f"both are seen in {both} frames; what was seen of the first one counts there" if both else ""

    def nobody(self, one: Nobody) -> str:
        self.groups.remove(self.find(one.who))
        return ""

    def swap(self, one: Swap) -> str:
        first, second = self.find(one.who), self.find(one.other)
        if first is second:
            raise _MisfitError("both places show the same person")
        changed = False
        for index in self.within(one.start, one.end):
            outside, inside = _split(first.parts.get(index, ()), one.start, one.end)
            other_outside, other_inside = _split(second.parts.get(index, ()), one.start, one.end)
            changed = changed or bool(inside or other_inside)
            first.parts[index], second.parts[index] = outside + other_inside, other_outside + inside
        if not changed:
            raise _MisfitError(f"neither of them is seen in {one.span}")
        return ""

    def exclude(self, one: Exclude) -> str:
        self.check(one.start)
        groups = self.groups if one.who is None else [self.find(one.who)]
        removed = False
        for group in groups:
            for index in self.within(one.start, one.end):
                group.parts[index], inside = _split(group.parts.get(index, ()), one.start, one.end)
                removed = removed or any(self.frames(index, part) for part in inside)
        return "" if removed else "nobody is seen there anyway"

    def main(self, one: Main) -> str:
        person = self.find(one.who)
        person.given = replace(person.given, main=True)
        return ""

    def height(self, one: Height) -> str:
        person = self.find(one.who)
        again = person.given.height_m
        person.given = replace(person.given, height_m=one.metres)
        return "" if again is None else f"it takes the place of {again:.2f} m, which another correction says"

    def sides(self, one: Sides) -> str:
        person = self.find(one.who)
        if not any(
            one.start <= frame < one.end
            for index in self.within(one.start, one.end)
            for part in person.parts.get(index, ())
            for frame in self.frames(index, part)
        ):
            raise _MisfitError(f"he is not seen in {one.span}")
        pair = places = None
        if one.joint is not None and one.left is not None and one.right is not None:
            pair = INDEX[f"left_{one.joint}"], INDEX[f"right_{one.joint}"]
            places = np.array([one.left, one.right])
        known = KnownSides(one.start, one.end, one.who.frame, pair, places)
        person.given = replace(person.given, sides=(*person.given.sides, known))
        return ""

    # ---- who and where

    def check(self, frame: int) -> None:
        """Raise if the video has no such frame."""
        if frame >= self.shots[-1].end:
            raise _MisfitError(f"frame {frame} does not exist: the video ends with frame {self.shots[-1].end - 1}")

    def within(self, start: int, end: int) -> list[int]:
        """Shots with frames in [start, end)."""
        self.check(start)
        return [index for index, shot in enumerate(self.shots) if shot.start < end and start < shot.end]

    def frames(self, index: int, part: TrackPart) -> list[int]:
        """Frames of a part of a track, inside its shot."""
        scene, shot = self.scenes[self.shots[index].scene], self.shots[index]
        if scene is None:
            return []
        frame = scene.tracks[part.track].frame
        bounds = (max(part.start, shot.start), min(part.end, shot.end))
        return [int(f) for f in frame[slice(*np.searchsorted(frame, bounds))]]

    def find(self, who: Who) -> _Group:
        """The person at a place in a frame; a misfit if nobody is there."""
        self.check(who.frame)
        index = next(k for k, shot in enumerate(self.shots) if shot.start <= who.frame < shot.end)
        scene = self.scenes[self.shots[index].scene]
        near: list[tuple[float, int, _Group]] = []
        for group in self.groups if scene is not None else ():
            for part in group.parts.get(index, ()):
                frames = self.frames(index, part)
                frame = min(frames, key=lambda f: abs(f - who.frame), default=None)
                if frame is None or abs(frame - who.frame) > NEAR_FRAMES:
                    continue
                assert scene is not None
                track = scene.tracks[part.track]
                off = _off_box(track.bbox[int(np.searchsorted(track.frame, frame))], who)
                if off <= ON_BOX:
                    near.append((off, abs(frame - who.frame), group))
        if not near:
            raise _MisfitError(f"nobody is seen at {who.x:.0f}, {who.y:.0f} in frame {who.frame}")
        return min(near, key=lambda one: one[:2])[2]

    def joined(self, index: int, first: Parts, second: Parts) -> tuple[Parts, int]:
        """Parts of one shot as those of one person, the first ones preferred; in how many frames there are both."""
        if not first or not second:
            return first or second, 0
        owner = {frame: part.track for part in second for frame in self.frames(index, part)}
        mine = {frame: part.track for part in first for frame in self.frames(index, part)}
        shared = len(owner.keys() & mine.keys())
        runs: list[TrackPart] = []
        for frame, track in sorted((owner | mine).items()):
            last = runs[-1] if runs else None
            # what was excluded between two frames of one track stays so
            if last is not None and last.track == track and not self.frames(index, TrackPart(track, last.end, frame)):
                runs[-1] = TrackPart(track, last.start, frame + 1)
            else:
                runs.append(TrackPart(track, frame, frame + 1))
        return tuple(runs), shared


def _off_box(xyxy: Float[np.ndarray, " 4"], who: Who) -> float:
    """How far a place lies from the middle of a box, in its widths and heights."""
    x0, y0, x1, y1 = (float(value) for value in xyxy)
    off_x, off_y = who.x - (x0 + x1) / 2, who.y - (y0 + y1) / 2
    return max(abs(off_x) / max(x1 - x0, 1.0), abs(off_y) / max(y1 - y0, 1.0))


def _split(parts: Parts, start: int, end: int) -> tuple[Parts, Parts]:
    """What of the parts lies outside [start, end), and what inside."""
    outside: list[TrackPart] = []
    inside: list[TrackPart] = []
    for part in parts:
        pieces = (
            (outside, part.start, min(part.end, start)),
            (inside, max(part.start, start), min(part.end, end)),
            (outside, max(part.start, end), part.end),
        )
        for side, first, last in pieces:
            if first < last:
                side.append(TrackPart(part.track, first, last))
    return tuple(outside), tuple(inside)


_APPLY: Mapping[type[Correction], Callable[..., str]] = {
    SamePerson: _Room.same,
    Nobody: _Room.nobody,
    Swap: _Room.swap,
    Exclude: _Room.exclude,
    Main: _Room.main,
    Height: _Room.height,
    Sides: _Room.sides,
}
