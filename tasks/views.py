"""Stage `views`: features of the place in every shot's key frames, by which shots of one place are joined."""

from collections.abc import Sequence

import cv2

from humanmm.models.camera.keyframes import (
    MAX_SIDE_PX,
    KeyViews,
    ViewFeatures,
    describe_view,
    in_source_pixels,
    key_frames,
)
from humanmm.models.camera.shot_edges import without_people
from humanmm.models.records.shots import ShotList
from humanmm.models.records.tracks import PersonTrack, ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.models.video.frames import Frame, frames_at
from humanmm.models.video.prefetch import prefetched
from humanmm.tasks.inputs import StageInputs


def views(inputs: StageInputs) -> KeyViews:
    """Key views of all shots, people left out; none where there is nothing to join."""
    facts = inputs.read("decode", VideoFacts)
    shots = inputs.read("shots", ShotList).shots
    people = inputs.read_all("people", ScenePeople)
    if len(shots) < 2:
        return KeyViews(of_shot=((),) * len(shots))
    tracks = [scene.tracks if (scene := people[shot.scene]) is not None else None for shot in shots]
    wanted = [() if seen is None else key_frames(shot) for seen, shot in zip(tracks, shots, strict=True)]
    cv2.setNumThreads(1)
    numbers = [frame for frames in wanted for frame in frames]
    with (
        inputs.open_video() as stream,
        prefetched(frames_at(stream, facts, numbers, pixels="gray", max_side_px=MAX_SIDE_PX)) as pictures,
    ):
        return KeyViews(
            tuple(
                tuple(_background(next(pictures), facts.width, seen or ()) for _ in frames)
                for seen, frames in zip(tracks, wanted, strict=True)
            )
        )


def _background(frame: Frame, width: int, people: Sequence[PersonTrack]) -> ViewFeatures:
    """Features of one picture in pixels of a source so wide, those on people left out."""
    view = in_source_pixels(describe_view(frame.index, frame.image), width / frame.image.shape[1])
    return without_people(view, people)
