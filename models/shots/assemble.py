"""The final shots: the scenes, cut further where people show it, with who is in them and which side is left."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from humanmm.errors import NoUsablePersonError
from humanmm.models.records.shots import Appearance, Scenes, Shot, ShotList, Transition
from humanmm.models.records.tracks import PersonTrack, ScenePeople
from humanmm.models.shots.identity import Cast, identify
from humanmm.models.shots.people_cuts import Parts, split_scenes
from humanmm.models.shots.side_swaps import Sighting, spans, swapped_spans
from humanmm.models.shots.tracking_failures import lapsed_frames

Spans = tuple[tuple[int, int], ...]


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
    shots = _empty_shots(scenes, transitions)
    cast = identify(shots, people, fps=fps)
    if not cast.people:
        raise NoUsablePersonError(
            "no usable person: nobody is seen clearly enough for long enough; "
            "give a video in which at least one whole body is visible"
        )
    if only_person is not None:
        cast = _only(cast, only_person)
    marks = _marks(shots, people, cast, time_s, K)
    inhabited = tuple(
        replace(shot, people=tuple(_marked(a, *marks.get((shot.index, a.person), ((), ()))) for a in appearances))
        for shot, appearances in zip(shots, cast.appearances, strict=True)
    )
    return ShotList(scenes.num_frames, inhabited, cast.people)


def _empty_shots(scenes: Scenes, transitions: Sequence[Transition]) -> list[Shot]:
    """Frames, scene, beginning and end of every shot, with nobody in them yet."""
    starts = [0, *(t.cut_frame for t in transitions)]
    scene_starts = np.array([start for start, _ in scenes.spans])
    return [
        Shot(
            index=index,
            start=start,
            end=end,
            scene=int(np.searchsorted(scene_starts, start, side="right")) - 1,
            transition=transitions[index - 1] if index else None,
            people=(),
            ending=transitions[index] if index < len(transitions) else None,
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
    return Cast(kept, tuple(tuple(a for a in shot if a.person == number) for shot in cast.appearances))


def _marks(
    shots: Sequence[Shot],
    people: Sequence[ScenePeople | None],
    cast: Cast,
    time_s: np.ndarray,
    K: np.ndarray,
) -> dict[tuple[int, int], tuple[Spans, Spans]]:
    """(shot, person) -> `swapped` and `lapses` of the appearance; sides are solved over the whole video, without the
    lapses."""
    marks: dict[tuple[int, int], tuple[Spans, Spans]] = {}
    for person in cast.people:
        seen: list[tuple[int, Sighting]] = []
        for shot, appearances in zip(shots, cast.appearances, strict=True):
            track = _track(people[shot.scene], appearances, person.person)
            if track is not None:
                seen.append((shot.index, _sighting(track, shot, time_s)))
        lost = [lapsed_frames(sighting) for _, sighting in seen]
        clear = [sighting.only(~lapsed) for (_, sighting), lapsed in zip(seen, lost, strict=True)]
        for (index, sighting), lapsed, swapped in zip(seen, lost, swapped_spans(clear, K), strict=True):
            marks[index, person.person] = swapped, spans(sighting.frame, lapsed)
    return marks


def _marked(appearance: Appearance, swapped: Spans, lapses: Spans) -> Appearance:
    return replace(appearance, swapped=swapped, lapses=lapses)


def _track(scene: ScenePeople | None, shot: Sequence[Appearance], person: int) -> PersonTrack | None:
    """A person's track in one shot."""
    number = next((a.track for a in shot if a.person == person), None)
    return None if scene is None or number is None else scene.tracks[number]


def _sighting(track: PersonTrack, shot: Shot, time_s: np.ndarray) -> Sighting:
    """The rows of a track in the clear frames of a shot."""
    inside = (track.frame >= shot.clear[0]) & (track.frame < shot.clear[1])
    frame = track.frame[inside]
    return Sighting(time_s[frame], frame, track.keypoints2d[inside], track.landmarks3d[inside])
