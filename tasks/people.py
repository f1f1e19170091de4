"""Everybody in one scene: keypoints, 3D landmarks, masks and tracks."""

from collections.abc import Iterator

from humanmm.models.perception.picture import Picture
from humanmm.models.perception.tracker import track_people
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.models.video.frames import PlanarFrame, planar_frames
from humanmm.models.video.prefetch import prefetched
from humanmm.tasks.inputs import StageInputs


def people(inputs: StageInputs) -> ScenePeople:
    """The tracks of all people in the scene's frames."""
    facts = inputs.read("decode", VideoFacts)
    settings = inputs.config.people
    start, end = inputs.span

    def pictures(decoded: Iterator[PlanarFrame]) -> Iterator[tuple[int, Picture]]:
        for frame in decoded:
            yield frame.index, Picture(frame.planes, frame.colors)
            inputs.progress(frame.index + 1 - start, end - start)

    with (
        inputs.open_video() as stream,
        prefetched(planar_frames(stream, facts, start, end, max_side_px=settings.max_side_px)) as decoded,
    ):
        return track_people(
            pictures(decoded),
            start=start,
            end=end,
            time_s=facts.time_s,
            size=(facts.width, facts.height),
            max_people=settings.max_people,
        )
