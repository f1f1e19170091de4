"""The final shots: the scenes, cut further where people show it, with who is in them and which side is left."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from humanmm.errors import NoUsablePersonError
from humanmm.models.motion.flips import Sighting, swapped_spans
from humanmm.models.perception.tracks import PersonTrack, ScenePeople
from humanmm.models.shots.boundaries import Appearance, Scenes, Shot, ShotList, Transition
from humanmm.models.shots.identity import Cast, ShotSpan, identify
from humanmm.models.shots.people_cuts import Parts, split_scenes


def assemble_shots(
    scenes: Scenes,
    people: Sequence[ScenePeople | None],
    *,
    time_s: np.ndarray,
    fps: float,
    K: np.ndarray,
    only_person: int | None = None,
    parts: Parts = "keypoints",
) -> ShotList:
    """Shots of the whole video with everybody in them (or with one person); `people` has None for a failed scene.

    K may be rough. Raises NoUsablePersonError when nobody, or not the wanted person, is in the video.
    """
    transitions = split_scenes(scenes, people, fps=fps, parts=parts)
    spans = _spans(scenes, transitions)
    cast = identify(spans, people, fps=fps)
    if not cast.people:
        raise NoUsablePersonError(
            "no usable person: nobody is seen clearly enough for long enough; "
            "give a video in which at least one whole body is visible"
        )
    if only_person is not None:
        cast = _only(cast, only_person)
    sides = _sides(spans, transitions, people, cast, time_s, K)
    shots = tuple(
        Shot(
            index=index,
            start=span.start,
            end=span.end,
            scene=span.scene,
            transition=transitions[index - 1] if index else None,
            people=tuple(replace(a, swapped=sides.get((index, a.person), ())) for a in cast.appearances[index]),
            ending=transitions[index] if index < len(transitions) else None,
        )
        for index, span in enumerate(spans)
    )
    return ShotList(scenes.num_frames, shots, cast.people)


def _spans(scenes: Scenes, transitions: Sequence[Transition]) -> list[ShotSpan]:
    """Frames and scene of every shot."""
    starts = [0, *(t.cut_frame for t in transitions)]
    scene_starts = np.array([start for start, _ in scenes.spans])
    return [
        ShotSpan(start, end, int(np.searchsorted(scene_starts, start, side="right")) - 1)
        for start, end in zip(starts, [*starts[1:], scenes.num_frames], strict=True)
    ]


def _only(cast: Cast, number: int) -> Cast:
    """The cast reduced to one person, who keeps the number."""
    kept = tuple(person for person in cast.people if person.person == number)
    if not kept:
        raise NoUsablePersonError(
            f"person {number} is not in the video: it has {len(cast.people)}, numbered from 0; choose another"
        )
    return Cast(kept, tuple(tuple(a for a in shot if a.person == number) for shot in cast.appearances))


def _sides(
    spans: Sequence[ShotSpan],
    transitions: Sequence[Transition],
    people: Sequence[ScenePeople | None],
    cast: Cast,
    time_s: np.ndarray,
    K: np.ndarray,
) -> dict[tuple[int, int], tuple[tuple[int, int], ...]]:
    """(shot, person) -> frame spans with left and right exchanged, solved for each person over the whole video."""
    mixed = np.zeros(len(time_s), dtype=bool)
    for t in transitions:
        mixed[t.start : t.end] = True
    sides: dict[tuple[int, int], tuple[tuple[int, int], ...]] = {}
    for person in cast.people:
        seen: list[tuple[int, Sighting]] = []
        for index, (span, shot) in enumerate(zip(spans, cast.appearances, strict=True)):
            track = _track(people[span.scene], shot, person.person)
            if track is not None:
                seen.append((index, _sighting(track, span, mixed, time_s)))
        solved = swapped_spans([sighting for _, sighting in seen], K)
        sides |= {(index, person.person): swapped for (index, _), swapped in zip(seen, solved, strict=True)}
    return sides


def _track(scene: ScenePeople | None, shot: Sequence[Appearance], person: int) -> PersonTrack | None:
    """A person's track in one shot."""
    number = next((a.track for a in shot if a.person == person), None)
    return None if scene is None or number is None else scene.tracks[number]


def _sighting(track: PersonTrack, span: ShotSpan, mixed: np.ndarray, time_s: np.ndarray) -> Sighting:
    """The rows of a track inside a shot that no gradual transition mixes with another shot."""
    inside = (track.frame >= span.start) & (track.frame < span.end)
    inside &= ~mixed[track.frame]
    frame = track.frame[inside]
    return Sighting(time_s[frame], frame, track.keypoints2d[inside], track.landmarks3d[inside])
