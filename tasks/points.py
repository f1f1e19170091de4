"""Stage `points`: long point tracks of one scene."""

from collections.abc import Iterator

import cv2
import numpy as np

from humanmm.models.camera.points import TrackerSettings, track_points
from humanmm.models.records.camera import PointTracks
from humanmm.models.records.video import VideoFacts
from humanmm.models.video.frames import frames
from humanmm.models.video.prefetch import prefetched
from humanmm.tasks.inputs import StageInputs
from humanmm.tasks.priority import at_low_priority


def points(inputs: StageInputs) -> PointTracks:
    """Points tracked through the scene's grey pictures, wherever they lie."""
    facts = inputs.read("decode", VideoFacts)
    start, stop = inputs.span
    settings = inputs.config.points
    cv2.setNumThreads(1)

    def pictures() -> Iterator[np.ndarray]:
        for frame in frames(stream, facts, start, stop, pixels="gray", max_side_px=settings.max_side_px):
            yield frame.image

    def tracked() -> PointTracks:
        with prefetched(pictures()) as small:
            return track_points(
                small,
                start=start,
                source_size=(facts.width, facts.height),
                settings=TrackerSettings(num_points=settings.num_points),
            )

    with inputs.open_video() as stream:
        return at_low_priority(tracked)  # `people`, beside it, takes three times as long
