"""A point tracker sees the grey pictures of its scene, reduced, one by one."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from short_clip import CLIP

from humanmm.models.camera.klt import klt_tracks
from humanmm.models.camera.points import track_points
from humanmm.models.records.camera import PointTracks
from humanmm.models.video.opened import Video
from humanmm.models.video.reading import read_facts


def test_another_tracker_gets_the_pictures_of_the_span_and_the_size_of_the_source() -> None:
    seen: list[tuple[int, ...]] = []

    def tracker(
        pictures: Iterable[np.ndarray], *, start: int, source_size: tuple[int, int], num_points: int
    ) -> PointTracks:
        assert (start, source_size, num_points) == (10, (720, 1280), 50)
        kept = list(pictures)
        seen.extend(picture.shape for picture in kept)
        return klt_tracks(kept, start=start, source_size=source_size, num_points=num_points)

    done: list[tuple[int, int]] = []
    with Path(CLIP).open("rb") as stream:
        video = Video(stream, read_facts(stream))
        progress = lambda frame, total: done.append((frame, total))  # noqa: E731
        tracks = track_points(video, (10, 14), max_side_px=320, num_points=50, tracker=tracker, progress=progress)
    assert seen == [(320, 180)] * 4
    assert (tracks.start, tracks.end) == (10, 14) and done == [(k, 4) for k in (1, 2, 3, 4)]
    assert tracks.xy[:, 1].max() > 640, "in source pixels"
    assert tracks.rate_hz == video.facts.fps
