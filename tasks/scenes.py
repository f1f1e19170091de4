"""Stage `scenes`: colour-based cuts and gradual transitions."""

from humanmm.models.records.shots import Scenes
from humanmm.models.records.video import VideoFacts
from humanmm.models.shots.footage import SIDE_PX
from humanmm.models.shots.scenes import SceneDetector
from humanmm.models.video.frames import frames
from humanmm.models.video.prefetch import prefetched
from humanmm.tasks.inputs import StageInputs


def scenes(inputs: StageInputs) -> Scenes:
    """Scenes of the whole video, from pictures of SIDE_PX."""
    facts = inputs.read("decode", VideoFacts)
    detector = SceneDetector(facts.time_s)
    with (
        inputs.open_video() as stream,
        prefetched(frames(stream, facts, pixels="bgr", max_side_px=SIDE_PX)) as decoded,
    ):
        for frame in decoded:
            detector.add(frame.image)
            inputs.progress(frame.index + 1, facts.num_frames)
    return detector.finish()
