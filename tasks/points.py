"""Stage `points`: long point tracks of one scene."""

from humanmm.models.camera.points import track_points
from humanmm.models.records.camera import PointTracks
from humanmm.models.records.video import VideoFacts
from humanmm.models.video.opened import Video
from humanmm.parts import load
from humanmm.tasks.inputs import StageInputs
from humanmm.tasks.priority import at_low_priority


def points(inputs: StageInputs) -> PointTracks:
    """Points tracked through the scene's grey pictures, on people too."""
    settings = inputs.config.points
    facts = inputs.read("decode", VideoFacts)
    with inputs.open_video() as stream:
        return at_low_priority(  # `people`, beside it, takes three times as long
            lambda: track_points(
                Video(stream, facts),
                inputs.span,
                max_side_px=settings.max_side_px,
                num_points=settings.num_points,
                tracker=load("points.tracker", settings.tracker),
                progress=inputs.progress,
            )
        )
