"""Stage `keyframes`: features and straight edges of the background in every shot's key frames."""

from humanmm.models.camera.background.keyframes import KeyFrameFeatures, describe_key_frames
from humanmm.models.records.shots import ShotList
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.models.video.opened import Video
from humanmm.tasks.inputs import StageInputs


def keyframes(inputs: StageInputs) -> KeyFrameFeatures:
    """Features and edges of all shots' key frames, people left out."""
    with inputs.open_video() as stream:
        return describe_key_frames(
            Video(stream, inputs.read("decode", VideoFacts)),
            inputs.read("shots", ShotList),
            inputs.read_all("people", ScenePeople),
            progress=inputs.progress,
        )
