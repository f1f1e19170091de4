"""Everybody in one scene of a video: decoding beside the networks, a few pictures ahead."""

from collections.abc import Iterator
from typing import Any

from humanmm.models.perception.interfaces import Lifter, Networks
from humanmm.models.perception.lifting.lifted import lifted_people
from humanmm.models.perception.networks import BEST
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.tracking.given_regions import GivenRegions, track_regions
from humanmm.models.perception.tracking.tracker import track_pictures
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.video.frames import PlanarFrame, planar_frames
from humanmm.models.video.opened import Video
from humanmm.models.video.prefetch import prefetched
from humanmm.models.video.progress import Progress, silent


def track_people(
    video: Video,
    span: tuple[int, int],
    *,
    max_people: int = 6,
    max_side_px: int = 1920,
    networks: Networks = BEST,
    lifter: Lifter | None = None,
    given: GivenRegions | None = None,
    hands: bool = False,
    progress: Progress = silent,
) -> ScenePeople:
    """Boxes, keypoints, 3D landmarks, masks and clothing colours of everybody in the frames [start, end) of one scene.

    `max_side_px` is the largest side of the pictures that the networks work on; results are in source pixels. The
    lifter is by default the shipped one. People are looked for where they are `given` alone, if they are. With `hands`
    their hands are looked at as well.
    """
    start, end = span

    def pictures(decoded: Iterator[PlanarFrame]) -> Iterator[tuple[int, Picture]]:
        for frame in decoded:
            yield frame.index, Picture(frame.planes, frame.colors)
            progress(frame.index + 1 - start, end - start)

    with prefetched(planar_frames(video.stream, video.facts, start, end, max_side_px=max_side_px)) as decoded:
        scene: dict[str, Any] = {
            "time_s": video.facts.time_s, "size": video.size, "max_people": max_people, "hands": hands,
        }  # fmt: skip
        if given is None:
            people = track_pictures(pictures(decoded), start=start, end=end, networks=networks, **scene)
        else:
            people = track_regions(pictures(decoded), given, span=span, networks=networks, **scene)
    if lifter is None:  # only now: torch takes two seconds to import
        from humanmm.models.perception.lifting.lift import lift

        lifter = lift
    return lifted_people(people, lifter, video.facts.time_s, video.size)
