"""Long point tracks of one scene: what a point tracker takes and returns, and its run over a video."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Protocol

import cv2
import numpy as np
from jaxtyping import UInt8

from humanmm.models.camera.klt import NUM_POINTS, klt_tracks
from humanmm.models.records.camera import PointTracks
from humanmm.models.video.frames import frames
from humanmm.models.video.light import brightened, gain_of
from humanmm.models.video.opened import Video
from humanmm.models.video.prefetch import prefetched
from humanmm.models.video.progress import Progress, silent


class PointTracker(Protocol):
    """Tracks points through a scene. It knows nothing of people; `masking` removes what lies on them."""

    def __call__(
        self,
        pictures: Iterable[UInt8[np.ndarray, "h w"]],
        *,
        start: int,
        source_size: tuple[int, int],
        num_points: int,
    ) -> PointTracks:
        """Tracks of about `num_points` points at a time.

        `pictures`: the grey pictures of frames start, start + 1, … of the video, one by one, all of one size;
        `source_size`: width and height of the source, in whose pixels (centres at .5) the tracks are.
        """
        ...


def track_points(
    video: Video,
    span: tuple[int, int],
    *,
    max_side_px: int = 640,
    num_points: int = NUM_POINTS,
    tracker: PointTracker = klt_tracks,
    progress: Progress = silent,
) -> PointTracks:
    """Points tracked through the frames [start, end) of one scene, in source pixels.

    `max_side_px` is the longest side of the grey pictures in which the tracker works; dark ones are brightened.
    """
    start, end = span
    cv2.setNumThreads(1)
    gain = gain_of(video.facts, start, end)

    def pictures() -> Iterator[UInt8[np.ndarray, "h w"]]:
        for frame in frames(video.stream, video.facts, start, end, pixels="gray", max_side_px=max_side_px):
            yield brightened(frame.image, gain)
            progress(frame.index + 1 - start, end - start)

    with prefetched(pictures()) as small:
        tracks = tracker(small, start=start, source_size=video.size, num_points=num_points)
    return replace(tracks, rate_hz=video.facts.fps)
