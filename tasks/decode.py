"""Stage `decode`: container facts and exact frame times; frames themselves are never stored."""

from humanmm.models.records.video import VideoFacts
from humanmm.models.video.reading import read_facts
from humanmm.tasks.inputs import StageInputs


def decode(inputs: StageInputs) -> VideoFacts:
    """Facts of the video."""
    settings = inputs.config.decode
    with inputs.open_video() as stream:
        return read_facts(stream, max_side_px=settings.max_side_px, max_memory_mb=settings.max_memory_mb)
