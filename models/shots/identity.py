"""Who is who across cuts: one number for one human being (what the paper's single-person method leaves open).

Every shot × track is a sighting. Shots are taken in order, and each shot's sightings are matched one to one with the
people known so far (Hungarian); a sighting that fits nobody better than chance starts a new person. The score is a sum
of log-odds, positive for "the same". The colours of the body's parts carry most, as far as they are not of one colour
themselves; then the clothes' histograms and the ground; the 3D poses on both sides of a cut (`same_pose`) decide where
colours leave it open. Bone lengths say nothing (`body.proportions`). Where the user trusts the numbers of his own
tracker, these decide.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.optimize import linear_sum_assignment
from scipy.special import expit, logit

from humanmm.models.body.body24 import load_body
from humanmm.models.body.proportions import bone_lengths, in_detector_convention, shape_from_bones
from humanmm.models.geometry.intervals import in_intervals
from humanmm.models.geometry.lines import line_through
from humanmm.models.perception.appearance import median_parts, same_look_odds
from humanmm.models.perception.clothing import mean_colours
from humanmm.models.records.shots import DOUBTFUL, Appearance, LeftOut, Person, Shot, TrackPart
from humanmm.models.records.tracks import PersonTrack, ScenePeople
from humanmm.models.shots import insets
from humanmm.models.shots.left_right_swaps import KnownSides
from humanmm.models.shots.same_pose import same_pose_odds
from humanmm.models.video.frame_times import ROUNDING_S, shown_s

NO_COLOURS = 1.5
"""Log-odds of one person where nobody's colours are known (keypoints without pictures): the pose alone parts nobody."""
NEVER, SURELY = -20.0, 20.0
"""Log-odds."""
CUT_GAP_FRAMES, CUT_GAP_S = 3, 0.1
"""A pose this many frames from a cut, or this long, still counts as the pose at the cut."""
POSE_FRAMES = 5

MIN_SEEN_S, MIN_SEEN_FRAMES = 0.3, 2
"""Whoever is seen for less in the whole video is nobody of it."""


@dataclass(frozen=True)
class GivenFacts:
    """What the user says of somebody."""

    main: bool = False
    """He is person 0, and a person for sure."""
    height_m: float | None = None
    sides: tuple[KnownSides, ...] = ()
    """Frames in which his left and right are known."""


@dataclass(frozen=True)
class Candidate:
    """Everything that was seen of somebody who may be a person."""

    sightings: tuple["Sighting", ...]
    given: GivenFacts = GivenFacts()


@dataclass(frozen=True)
class Cast:
    """Everybody in the video: people by number, and for each shot who appears on which track."""

    people: tuple[Person, ...]
    appearances: tuple[tuple[Appearance, ...], ...]
    left_out: tuple[LeftOut, ...] = ()
    """Who is hardly a person, likeliest first."""
    given: tuple[GivenFacts, ...] = ()
    """What the user says of each of the people."""


@dataclass(frozen=True)
class Answer:
    """Who somebody in a shot is said to be."""

    probability: float
    """That it is right, against the best other answer."""
    other: int | None
    """That answer: another person's number; None: nobody who was seen before."""


@dataclass(frozen=True)
class Sighting:
    """One track inside one shot."""

    shot: int
    track: int
    first: Float[np.ndarray, "33 3"] | None
    """3D pose at the shot's first frame; None when not seen there."""
    last: Float[np.ndarray, "33 3"] | None
    colours: Float[np.ndarray, " bins"]
    part_colours: Float[np.ndarray, "9 3"]
    """Median over the shot of `clothing.PARTS` and of the ground about the feet; NaN where not seen."""
    area: float
    num_frames: int
    seen_s: float
    """How long those frames are shown."""
    log_odds: float
    """Of being a person who was filmed."""
    inset: bool
    """Seen in a picture within the picture."""
    bones: Float[np.ndarray, "frames 7"]
    """Lengths of confident frames, metres, as the pose network measures them."""
    parts: tuple[TrackPart, ...] = ()
    """As in `Appearance`."""
    number: int = -1
    """As in `PersonTrack`."""

    @property
    def look(self) -> tuple[Float[np.ndarray, " bins"], Float[np.ndarray, "9 3"]]:
        """Colours of the clothes and of the parts."""
        return self.colours, self.part_colours


def matched_people(
    shots: Sequence[Shot], scenes: Sequence[ScenePeople | None], *, time_s: Float[np.ndarray, " F"]
) -> list[list[Sighting]]:
    """All sightings, those of one and the same person together; a failed scene is None.

    `time_s` holds the presentation times of all frames.
    """
    people: list[list[Sighting]] = []
    for index, shot in enumerate(shots):
        scene = scenes[shot.scene]
        tracks = scene.tracks if scene is not None else ()
        sightings = [s for k, track in enumerate(tracks) if (s := sighting(index, shot, k, track, time_s)) is not None]
        for known, new in match(people, sightings).items():
            if known < len(people):
                people[known].append(sightings[new])
            else:
                people.append([sightings[new]])
    return people


def cast_of(people: Sequence[Candidate], num_shots: int, *, min_confidence: float = 0.2) -> Cast:
    """Number the people of `num_shots` shots: the main one first, the doubtful ones last.

    Left out is who is seen for a moment only, and who is a person with a lower probability than `min_confidence`.
    """
    candidates = [
        (1.0 if p.given.main else probability(p.sightings), sum(s.area for s in p.sightings), p)
        for p in people
        if is_long_seen(p.sightings)
    ]
    kept = [candidate for candidate in candidates if candidate[0] >= min_confidence]
    kept.sort(key=lambda candidate: (not candidate[2].given.main, candidate[0] < DOUBTFUL, -candidate[1]))
    body = load_body()
    numbered = tuple(
        Person(
            number,
            shape_from_bones(np.concatenate([s.bones for s in p.sightings]), body, height_m=p.given.height_m),
            area,
            likelihood,
            height_known=p.given.height_m is not None,
            inset=not p.given.main and all(s.inset for s in p.sightings),
        )
        for number, (likelihood, area, p) in enumerate(kept)
    )
    appearances: list[list[Appearance]] = [[] for _ in range(num_shots)]
    for number, (_, _, p) in enumerate(kept):
        for s in p.sightings:
            appearances[s.shot].append(Appearance(number, s.track, parts=s.parts))
    hardly = sorted((one for one in candidates if one[0] < min_confidence), key=lambda one: -one[0])
    left_out = tuple(LeftOut(likelihood, tuple(sorted({s.shot for s in p.sightings}))) for likelihood, _, p in hardly)
    return Cast(numbered, tuple(map(tuple, appearances)), left_out, tuple(p.given for _, _, p in kept))


def sighting(
    index: int, shot: Shot, number: int, track: PersonTrack, time_s: Float[np.ndarray, " F"]
) -> Sighting | None:
    """What one track shows of a person in one shot outside transitions; None when nothing."""
    inside = np.flatnonzero(in_intervals(track.frame, [shot.outside_transitions]))
    if not len(inside):
        return None
    confidence = track.confidence[inside].astype(np.float64)
    confident = inside[confidence >= np.median(confidence)]
    bones = bone_lengths(track.landmarks3d[confident].astype(np.float64))
    boxes = track.bbox[inside].astype(np.float64)
    inset = insets.in_inset(boxes, shot.burned_in)
    return Sighting(
        shot=index,
        track=number,
        first=pose_at(track, inside[:POSE_FRAMES], shot.start, time_s),
        last=pose_at(track, inside[-POSE_FRAMES:], shot.end - 1, time_s),
        colours=_colours(track, shot),
        part_colours=_part_colours(track, shot),
        area=float((boxes[:, 2:] - boxes[:, :2]).prod(axis=1).sum()),
        num_frames=len(inside),
        seen_s=float(shown_s(time_s, track.frame[inside]).sum()),
        log_odds=float(logit(np.clip(track.probability, 1e-4, insets.PROBABILITY if inset else 1 - 1e-4))),
        inset=inset,
        bones=in_detector_convention(bones, lifted=track.is_in_space),
        number=track.number,
    )


def _colours(track: PersonTrack, shot: Shot) -> Float[np.ndarray, " bins"]:
    """Mean clothing colours inside the shot; of the whole track when none were taken there."""
    inside = in_intervals(track.color_frame, [shot.outside_transitions])
    chosen = track.color_histogram[inside] if inside.any() else track.color_histogram
    return mean_colours(chosen)


def _part_colours(track: PersonTrack, shot: Shot) -> Float[np.ndarray, "9 3"]:
    """Median inside the shot; of the whole track when none were taken there."""
    if track.color_parts is None:
        return median_parts([])
    inside = in_intervals(track.color_frame, [shot.outside_transitions])
    return median_parts(track.color_parts[inside] if inside.any() else track.color_parts)


def pose_at(
    track: PersonTrack, rows: np.ndarray, frame: int, time_s: Float[np.ndarray, " F"]
) -> Float[np.ndarray, "33 3"] | None:
    """The 3D landmarks of some rows carried linearly to a frame; None when the nearest row is too far from it."""
    offsets = time_s[track.frame[rows]] - time_s[frame]
    gap, gap_s = np.abs(track.frame[rows] - frame).min(), np.abs(offsets).min()
    if gap > CUT_GAP_FRAMES and gap_s > CUT_GAP_S + ROUNDING_S:
        return None
    poses = track.landmarks3d[rows].astype(np.float64)
    if len(rows) < 3:
        return np.asarray(poses.mean(axis=0))
    return line_through(offsets, poses)[0]


def match(people: Sequence[Sequence[Sighting]], sightings: Sequence[Sighting]) -> dict[int, int]:
    """Known person -> sighting of the best one-to-one matching; numbers from len(people) on are new people."""
    odds = np.array([[same_person_odds(person, new) for new in sightings] for person in people])
    odds = odds.reshape(len(people), len(sightings))
    rows, columns = linear_sum_assignment(-np.maximum(odds, 0))
    matched = {int(r): int(c) for r, c in zip(rows, columns, strict=True) if odds[r, c] > 0}
    strangers = [k for k in range(len(sightings)) if k not in matched.values()]
    return matched | {len(people) + i: k for i, k in enumerate(strangers)}


def same_person_odds(person: Sequence[Sighting], new: Sighting) -> float:
    """Log-odds that a sighting shows a known person: best colours of any of the person's shots, pose at the cut.
    Nobody leaves a picture within the picture. Numbers that the user trusts say all."""
    numbers = {old.number for old in person} - {-1}
    if numbers and new.number >= 0:
        return SURELY if new.number in numbers else NEVER
    if new.inset != person[-1].inset:
        return NEVER
    looks = [old.look for old in person if old.colours.any()]
    known = looks and new.colours.any()
    odds = max(same_look_odds(*look, *new.look) for look in looks) if known else NO_COLOURS
    before = person[-1]
    if before.shot == new.shot - 1 and before.last is not None and new.first is not None:
        odds += same_pose_odds(before.last, new.first)
    return odds


def identity_answers(
    shots: Sequence[Shot], scenes: Sequence[ScenePeople | None], time_s: Float[np.ndarray, " F"]
) -> dict[tuple[int, int], Answer]:
    """By person and shot, of every shot after the first in which anybody is seen: how sure it is that he is who he is
    said to be.

    `scenes`: None where the detector failed.
    """
    known: dict[int, list[Sighting]] = {}
    found = {}
    for shot in shots:
        scene = scenes[shot.scene]
        seen = {
            one.person: view
            for one in shot.people
            if scene is not None
            and (view := sighting(shot.index, shot, one.track, scene.track_of(one), time_s)) is not None
        }
        if known:
            found.update({(new, shot.index): answer for new, answer in answers_of(known, seen).items()})
        for person, view in seen.items():
            known.setdefault(person, []).append(view)
    return found


def answers_of(known: Mapping[int, Sequence[Sighting]], seen: Mapping[int, Sighting]) -> dict[int, Answer]:
    """For everybody seen in a shot, by number: that he is the one of this number, or nobody known if there is none.

    From the log-odds of this answer against the best other one.
    """
    odds = {
        (person, new): same_person_odds(sightings, view)
        for person, sightings in known.items()
        for new, view in seen.items()
    }
    return {new: _answer(new, seen, known, odds) for new in seen}


def _answer(
    new: int,
    seen: Mapping[int, Sighting],
    known: Mapping[int, Sequence[Sighting]],
    odds: Mapping[tuple[int, int], float],
) -> Answer:
    """The answer for somebody in a shot against the best other one: that he is new, or somebody else, who would then be
    he if he is seen in the shot as well."""
    own = odds.get((new, new), 0.0)  # 0: nobody who was known
    others: dict[int | None, float] = {None: 0.0} if new in known else {}
    for person in known.keys() - {new}:
        others[person] = odds[person, new]
        if person in seen:
            others[person] += max(0.0, odds.get((new, person), 0.0)) - odds[person, person]
    best = max(others, key=lambda other: others[other])
    return Answer(float(expit(own - others[best])), best)


def is_long_seen(person: Sequence[Sighting]) -> bool:
    """Whether somebody is seen for so long that he is a person of the video."""
    frames, seconds = sum(s.num_frames for s in person), sum(s.seen_s for s in person)
    return frames >= MIN_SEEN_FRAMES and seconds >= MIN_SEEN_S - ROUNDING_S


def probability(person: Sequence[Sighting]) -> float:
    """That somebody is a person, from all his tracks, each counting by its frames."""
    odds = np.average([s.log_odds for s in person], weights=[s.num_frames for s in person])
    return float(expit(odds))
