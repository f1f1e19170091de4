"""The final shots: the scenes, cut further where people show it, with the people and the detector's errors in them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from humanmm.corrections import NONE, Corrections, RemoveCut
from humanmm.errors import NoUsablePersonError
from humanmm.models.geometry.intervals import Interval, frame_intervals, in_intervals
from humanmm.models.geometry.intrinsics import K_from_focal, default_focal_px
from humanmm.models.records.shots import Appearance, CorrectionNote, Scenes, Shot, ShotList, Transition, Unfollowed
from humanmm.models.records.tracks import PersonTrack, ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.models.shot_detection.corrected_cuts import NEAR_FRAMES, removed, settled
from humanmm.models.shot_detection.people_cuts import Parts, Split, split_scenes
from humanmm.models.shots.corrected_people import corrected_people
from humanmm.models.shots.identity import (
    MIN_SEEN_FRAMES,
    MIN_SEEN_S,
    Candidate,
    Cast,
    cast_of,
    is_long_seen,
    matched_people,
    probability,
)
from humanmm.models.shots.insets import without_insets
from humanmm.models.shots.left_right_swaps import SidesSeen, left_right_swaps
from humanmm.models.shots.tracking_failures import failed_frames
from humanmm.models.shots.turned_picture import turned_picture
from humanmm.models.video.frame_times import ROUNDING_S, shown_s

WHOLE = 0.45
"""Confidence, in the median over time, of somebody who is in view as a whole: 0.5 to 0.98 in real clips; of upper
bodies and of people behind desks 0.2 to 0.43."""
NAMED = 3
"""So many of the people who are overlooked are named in a warning."""


def detect_shots(
    facts: VideoFacts,
    scenes: Scenes,
    people: Sequence[ScenePeople | None],
    *,
    only_person: int | None = None,
    min_confidence: float = 0.2,
    need_people: bool = True,
    parts: Parts = "keypoints",
    corrections: Corrections = NONE,
) -> ShotList:
    """Shots of the whole video with everybody in them (or with one person); `people` has None for a failed scene.

    `parts` says how much of the three-part detector is used: colours, boxes, keypoints. Left and right are
    distinguished with a rough K, for the focal length is estimated later. Who is a person with a lower probability than
    `min_confidence` is left out. `corrections`: what the user knows better of cuts and people; the result says which
    of them fit. Raises NoUsablePersonError when nobody, or not the wanted person, is in the video.
    """
    time_s = facts.time_s
    split = split_scenes(scenes, without_insets(people, scenes), time_s=time_s, parts=parts)
    (transitions, suspected), notes = _corrected(scenes, split, corrections)
    shots = _empty_shots(scenes, transitions)
    groups = matched_people(shots, people, time_s=time_s)
    candidates, of_people = corrected_people(groups, shots, people, corrections, time_s=time_s)
    cast = cast_of(candidates, len(shots), min_confidence=min_confidence)
    if not cast.people and need_people:
        raise NoUsablePersonError(_nobody(cast, min_confidence, time_s))
    if only_person is not None:
        cast = _only(cast, only_person)
    filmed = ShotList(scenes.num_frames, tuple(shots), ()).filmed_size(facts.width, facts.height)
    K = K_from_focal(default_focal_px(*filmed), facts.width, facts.height)
    faults, unanswered = _detector_faults(shots, people, cast, time_s, K)
    inhabited = tuple(
        replace(shot, people=tuple(_marked(a, faults.get((shot.index, a.person))) for a in appearances))
        for shot, appearances in zip(shots, cast.appearances, strict=True)
    )
    starts = [shot.start for shot in shots]
    suspected = tuple(frame for frame in suspected if all(abs(frame - start) > NEAR_FRAMES for start in starts))
    warnings = (
        *_suspected_cuts(suspected), *_doubts(cast), *_briefly_seen(candidates, min_confidence),
        *_partly_seen(cast, inhabited, people),
        *_overlooked(people, (facts.width, facts.height)), *unanswered,
        *turned_picture(_seen_for_certain(cast, inhabited, people, time_s)),
    )  # fmt: skip
    unfollowed = tuple(one for scene in people if scene is not None for one in scene.unfollowed)
    return ShotList(
        scenes.num_frames, inhabited, cast.people, warnings, (*notes, *of_people), cast.left_out, unfollowed, suspected
    )


def _corrected(scenes: Scenes, split: Split, corrections: Corrections) -> tuple[Split, list[CorrectionNote]]:
    """The cuts without those of people that the user removes, and what became of all corrections of cuts."""
    kept, notes = removed(split.transitions, corrections.of(RemoveCut), fixed=scenes.transitions)
    suspected, notes = settled(split.suspected, notes, corrections)
    # what colours and people show is removed in two places, and a correction fits if it does in one of them
    done = {note.identity: note for note in (*scenes.corrections, *notes) if note.applied}
    misfits = {note.identity: note for note in (*scenes.corrections, *notes) if note.identity not in done}
    return Split(tuple(kept), suspected), [*done.values(), *misfits.values()]


def _nobody(cast: Cast, min_confidence: float, time_s: Float[np.ndarray, " F"]) -> str:
    length_s = float(shown_s(time_s, np.arange(len(time_s))).sum())
    if length_s < MIN_SEEN_S - ROUNDING_S:
        return (
            f"no usable person: the video is too short, {len(time_s)} frames in {length_s:.2g} s; somebody must be "
            f"seen for {MIN_SEEN_S:g} s: give a longer one"
        )
    if not cast.left_out:
        return (
            "no usable person: nobody is seen for long enough; give a video in which somebody's shoulders are visible"
        )
    likeliest = cast.left_out[0].probability
    return (
        f"no usable person: the likeliest of {len(cast.left_out)} is one with a probability of {likeliest:.2f}, "
        f"less than {min_confidence:g}; --min-confidence {0.9 * likeliest:.2g} admits him"
    )


def _suspected_cuts(suspected: Sequence[int]) -> tuple[str, ...]:
    """A warning for every frame that may begin a shot and begins none."""
    return tuple(
        f"frame {frame} may be a jump cut: what moves jumps there; `humanmm correct RUN add-cut {frame}` makes it one, "
        f"remove-cut {frame} says that it is none"
        for frame in suspected
    )


def _doubts(cast: Cast) -> tuple[str, ...]:
    """A warning for everybody who may be nobody, or was filmed somewhere else."""
    return tuple(
        f"person {person.person} is seen in a picture within the picture, which does not change at cuts: doubtful, "
        f"he joins no shots; if he belongs to the film, `humanmm correct RUN main` says so"
        if person.inset
        else f"person {person.person} may be no person: the probability is {person.probability:.2f}"
        for person in cast.people
        if person.doubtful
    )


def _briefly_seen(candidates: Sequence[Candidate], min_confidence: float) -> tuple[str, ...]:
    """A warning for everybody who would be in the results if he were seen for longer."""
    return tuple(
        f"somebody is seen for {sum(s.seen_s for s in one.sightings):.2f} s only (shots "
        f"{', '.join(str(s.shot) for s in one.sightings)}) and is left out: {MIN_SEEN_S:g} s and {MIN_SEEN_FRAMES} "
        "frames are needed"
        for one in candidates
        if not is_long_seen(one.sightings) and (one.given.main or probability(one.sightings) >= min_confidence)
    )


def _partly_seen(cast: Cast, shots: Sequence[Shot], people: Sequence[ScenePeople | None]) -> tuple[str, ...]:
    """A warning for everybody of whom much is out of view or covered most of the time: the rest of him is a guess."""
    trust: dict[int, list[float]] = {}
    for person, track, here in _seen(shots, people):
        if not track.lifted:
            trust.setdefault(person, []).extend(track.confidence[here].tolist())
    median = {person: float(np.median(values)) for person, values in trust.items() if values}
    return tuple(
        f"person {one.person} is seen in part (confidence {median[one.person]:.2f}): what is out of view or covered is "
        "a guess"
        for one in cast.people
        if not one.doubtful and median.get(one.person, 1.0) < WHOLE
    )


def _seen_for_certain(
    cast: Cast, shots: Sequence[Shot], people: Sequence[ScenePeople | None], time_s: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Of all who are certainly people: keypoints, and the seconds for which each frame is shown."""
    certain = {person.person for person in cast.people if not person.doubtful}
    for person, track, here in _seen(shots, people):
        if person in certain:
            yield track.keypoints2d[here], shown_s(time_s, track.frame[here])


def _seen(shots: Sequence[Shot], people: Sequence[ScenePeople | None]) -> Iterator[tuple[int, PersonTrack, np.ndarray]]:
    """Everybody in every shot: number, track, and which of its rows are of the shot."""
    for shot in shots:
        scene = people[shot.scene]
        if scene is not None:
            for one in shot.people:
                track = scene.tracks[one.track]
                yield one.person, track, (track.frame >= shot.start) & (track.frame < shot.end)


def _overlooked(people: Sequence[ScenePeople | None], size: tuple[int, int]) -> Iterator[str]:
    """A warning for every scene in which people are seen whom nothing follows."""
    for scene in people:
        unfollowed = sorted(scene.unfollowed, key=lambda one: -one.score) if scene is not None else []
        for crowded in (False, True):
            alike = [one for one in unfollowed if one.crowded is crowded]
            if not alike:
                continue
            places = ", ".join(_place(one, size) for one in alike[:NAMED])
            more = f" (and {len(alike) - NAMED} more)" if len(alike) > NAMED else ""
            why = (
                "more people than --people.max-people are seen" if crowded else "somebody is seen who is not recovered"
            )
            yield f"{why}: {places} of the picture{more}"


def _place(one: Unfollowed, size: tuple[int, int]) -> str:
    x0, y0, x1, y1 = np.clip(np.array(one.box) / [*size, *size], 0, 1)
    return f"in frames {one.first}-{one.last} at {x0:.2f} {y0:.2f} {x1:.2f} {y1:.2f}"


def _empty_shots(scenes: Scenes, transitions: Sequence[Transition]) -> list[Shot]:
    """Frames, scene, beginning and end of every shot, with nobody in them yet."""
    starts = [0, *(t.cut_frame for t in transitions)]
    scene_starts = np.array([start for start, _ in scenes.spans])
    scene_of = (np.searchsorted(scene_starts, starts, side="right") - 1).tolist()
    return [
        Shot(
            index=index,
            start=start,
            end=end,
            scene=scene_of[index],
            transition=transitions[index - 1] if index else None,
            people=(),
            ending=transitions[index] if index < len(transitions) else None,
            burned_in=scenes.burned_in[scene_of[index]] if scenes.burned_in else (),
        )
        for index, (start, end) in enumerate(zip(starts, [*starts[1:], scenes.num_frames], strict=True))
    ]


def _only(cast: Cast, number: int) -> Cast:
    """The cast reduced to one person, who keeps the number."""
    kept = tuple(person for person in cast.people if person.person == number)
    if not kept:
        raise NoUsablePersonError(
            f"person {number} is not in the video: it has {len(cast.people)}, numbered from 0; choose another"
        )
    given = tuple(given for person, given in zip(cast.people, cast.given, strict=True) if person.person == number)
    return Cast(kept, tuple(tuple(a for a in shot if a.person == number) for shot in cast.appearances), given=given)


@dataclass(frozen=True)
class _Faults:
    """Frames of one person in one shot in which the detector was wrong."""

    left_right_swapped: tuple[Interval, ...]
    tracking_failures: tuple[Interval, ...]


def _detector_faults(
    shots: Sequence[Shot],
    people: Sequence[ScenePeople | None],
    cast: Cast,
    time_s: np.ndarray,
    K: np.ndarray,
) -> tuple[dict[tuple[int, int], _Faults], list[str]]:
    """By (shot, person). Left-right swaps are solved over the whole video, without the tracking failures. A warning for
    what the user says of sides where nothing is left to be compared with it."""
    faults: dict[tuple[int, int], _Faults] = {}
    unanswered: list[str] = []
    for person, given in zip(cast.people, cast.given, strict=True):
        seen: list[tuple[int, SidesSeen]] = []
        for shot, appearances in zip(shots, cast.appearances, strict=True):
            track = _track(people[shot.scene], appearances, person.person)
            if track is not None:
                seen.append((shot.index, _sighting(track, shot, time_s)))
        failed = [failed_frames(sighting) for _, sighting in seen]
        trusted = [sighting.only(~lost) for (_, sighting), lost in zip(seen, failed, strict=True)]
        swaps = left_right_swaps(trusted, K, given.sides)
        unanswered += [
            f"the correction of person {person.person}'s left and right in frame {one.frame} is left out: he is not "
            "seen well enough near it; name a frame in which he is"
            for one in given.sides
            if not one.is_answered(trusted)
        ]
        for (index, sighting), lost, swapped in zip(seen, failed, swaps, strict=True):
            faults[index, person.person] = _Faults(swapped, frame_intervals(sighting.frame, lost))
    return faults, unanswered


def _marked(appearance: Appearance, faults: _Faults | None) -> Appearance:
    if faults is None:
        return appearance
    return replace(appearance, left_right_swapped=faults.left_right_swapped, tracking_failures=faults.tracking_failures)


def _track(scene: ScenePeople | None, shot: Sequence[Appearance], person: int) -> PersonTrack | None:
    """A person's track in one shot."""
    own = next((a for a in shot if a.person == person), None)
    return None if scene is None or own is None else scene.track_of(own)


def _sighting(track: PersonTrack, shot: Shot, time_s: np.ndarray) -> SidesSeen:
    """The rows of a track in the clear frames of a shot."""
    inside = in_intervals(track.frame, [shot.clear])
    frame = track.frame[inside]
    return SidesSeen(
        time_s[frame], shown_s(time_s, frame), frame, track.keypoints2d[inside], track.landmarks3d[inside],
        track.pose.swap_odds[inside] if track.pose is not None else None,
        track.side_odds[inside] if track.side_odds is not None else None,
    )  # fmt: skip
