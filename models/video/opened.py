"""A video as the stages take it: its bytes, opened for reading, and what is known of its frames."""

from dataclasses import dataclass
from typing import BinaryIO

from humanmm.models.records.video import VideoFacts


@dataclass(frozen=True)
class Video:
    """An opened video. Whoever opened the stream closes it; one function reads from it at a time."""

    stream: BinaryIO
    """Seekable, binary."""
    facts: VideoFacts

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the upright picture, pixels."""
        return self.facts.width, self.facts.height
