"""Stage `scenes`: colour-based cuts and gradual transitions."""

from humanmm.models.records.shots import Scenes
from humanmm.models.records.video import VideoFacts
from humanmm.models.shot_detection.scenes import detect_scenes
from humanmm.models.video.opened import Video
from humanmm.tasks.inputs import StageInputs


def scenes(inputs: StageInputs) -> Scenes:
    """Scenes of the whole video."""
    with inputs.open_video() as stream:
        video = Video(stream, inputs.read("decode", VideoFacts))
        return detect_scenes(video, corrections=inputs.corrections, progress=inputs.progress)
