"""Stage `decode`: container facts and exact frame times; frames themselves are never stored."""

import logging

from humanmm.models.records.video import VideoFacts
from humanmm.models.video.reading import read_facts
from humanmm.tasks.inputs import StageInputs

log = logging.getLogger(__name__)


def decode(inputs: StageInputs) -> VideoFacts:
    """Facts of the video."""
    settings = inputs.config.decode
    with inputs.open_video() as stream:
        facts = read_facts(stream, max_side_px=settings.max_side_px, max_memory_mb=settings.max_memory_mb)
    if facts.interlaced:
        log.info("the video is interlaced: every picture is used as its first field (%s) shows it", facts.first_field)
    return facts
