"""Everybody in one scene of a video: decoding beside the networks, a few pictures ahead."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from humanmm.models.perception.between_looks import in_frames, looked_at, times_of
from humanmm.models.perception.interfaces import Lifter, Networks
from humanmm.models.perception.keypoints.fusion import BEST
from humanmm.models.perception.lent_joints import without_lent_joints
from humanmm.models.perception.lifting.lifted import lifted_people
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.tracking.given_regions import GivenRegions, sparse, track_regions
from humanmm.models.perception.tracking.tracker import CAREFUL_FRAMES, track_pictures
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.video.frames import PlanarFrame, planar_frames
from humanmm.models.video.light import gain_of
from humanmm.models.video.opened import Video
from humanmm.models.video.prefetch import prefetched
from humanmm.models.video.progress import Progress, silent


def track_people(
    video: Video,
    span: tuple[int, int],
    *,
    max_people: int = 6,
    max_side_px: int = 1920,
    max_rate_hz: float = 30.0,
    networks: Networks = BEST,
    lifter: Lifter | None = None,
    given: GivenRegions | None = None,
    hands: bool = False,
    progress: Progress = silent,
) -> ScenePeople:
    """Boxes, keypoints, 3D landmarks, masks and clothing colours of everybody in the frames [start, end) of one scene.

    `max_side_px` is the largest side of the pictures that the networks work on, which are brightened where they are
    dark; results are in source pixels. Of a second no more than about `max_rate_hz` frames are looked at, what lies
    between is interpolated. The lifter is by default the shipped one. People are looked for where they are `given`
    alone, if they are, and in every frame for which somebody is. With `hands` their hands are looked at as well.
    """
    start, end = span
    time_s = video.facts.time_s
    gain = gain_of(video.facts, start, end)
    looks = looked_at(time_s, span, max_rate_hz=max_rate_hz, every=CAREFUL_FRAMES)
    if given is not None:
        looks = np.union1d(looks, given.frame[(given.frame >= start) & (given.frame < end)])

    def pictures(decoded: Iterator[PlanarFrame]) -> Iterator[tuple[int, Picture]]:
        look = 0
        for frame in decoded:
            if look < len(looks) and frame.index == looks[look]:
                yield look, Picture(frame.planes, frame.colors, gain)
                look += 1
            progress(frame.index + 1 - start, end - start)

    with prefetched(planar_frames(video.stream, video.facts, start, end, max_side_px=max_side_px)) as decoded:
        scene: dict[str, Any] = {
            "time_s": times_of(looks, end, time_s), "size": video.size, "max_people": max_people, "hands": hands,
        }  # fmt: skip
        if given is None:
            seen = track_pictures(pictures(decoded), start=0, end=len(looks), networks=networks, **scene)
        else:
            seen = track_regions(
                pictures(decoded), _of_looks(given, looks, time_s), span=(0, len(looks)), networks=networks, **scene
            )
    own = without_lent_joints(seen, time_s[looks])
    people = in_frames(own, looks, span, time_s)
    if lifter is None:  # only now: torch takes two seconds to import
        from humanmm.models.perception.lifting.lift import lift

        lifter = lift
    return lifted_people(people, lifter, time_s, video.size)


def _of_looks(given: GivenRegions, looks: Int[np.ndarray, " L"], time_s: Float[np.ndarray, " F"]) -> GivenRegions:
    """The regions in the frames that are looked at, which are numbered from 0 on, and a warning if they are few."""
    rows = np.isin(given.frame, looks)
    labels = given.labels
    return GivenRegions(
        np.searchsorted(looks, given.frame[rows]),
        given.person[rows],
        given.box[rows],
        given.score[rows],
        None if labels is None else lambda look: labels(int(looks[look])),
        (*given.warnings, *sparse(given.frame[rows], time_s)),
        given.lasting,
    )
