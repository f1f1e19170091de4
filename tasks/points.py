"""Stage `points`: long point tracks of one scene, and the features of its key frames."""

from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np

from humanmm.models.camera.observations import PointTracks
from humanmm.models.camera.points import TrackerSettings, track_points
from humanmm.models.camera.views import MAX_SIDE_PX, ViewFeatures, describe_view, in_source_pixels, key_frames
from humanmm.models.video.ahead import ahead
from humanmm.models.video.facts import VideoFacts
from humanmm.models.video.frames import frames, scaled_size
from humanmm.tasks.inputs import StageInputs


def points(inputs: StageInputs) -> PointTracks:
    """Points tracked through the scene's grey pictures, wherever they lie."""
    facts = inputs.read("decode", VideoFacts)
    start, stop = inputs.span
    settings = inputs.config.points
    views: list[ViewFeatures] = []
    view_frames = key_frames(start, stop, float(facts.time_s[stop - 1] - facts.time_s[start]))
    tracking_size = scaled_size(facts, settings.max_side_px)
    cv2.setNumThreads(1)

    def pictures() -> Iterator[np.ndarray]:
        for frame in frames(stream, facts, start, stop, pixels="gray", max_side_px=max(MAX_SIDE_PX, *tracking_size)):
            if frame.index in view_frames:
                view = describe_view(frame.index, frame.image)
                views.append(in_source_pixels(view, facts.width / frame.image.shape[1]))
            yield cv2.resize(frame.image, tracking_size, interpolation=cv2.INTER_AREA)

    with inputs.open_video() as stream, ahead(pictures()) as small:
        tracks = track_points(
            small,
            start=start,
            source_size=(facts.width, facts.height),
            settings=TrackerSettings(num_points=settings.num_points),
        )
    return replace(tracks, views=tuple(views))
