"""The video inside the page: the overlay, small, and with a keyframe for every second, for quick jumps."""

import math
from contextlib import ExitStack
from pathlib import Path

import cv2
import numpy as np

from humanmm.models.records.video import VideoFacts
from humanmm.models.video.colors import Colors, read_colors
from humanmm.models.video.frames import Planes, planar_frames, planar_size
from humanmm.models.video.prefetch import prefetched
from humanmm.models.video.reading import read_facts
from humanmm.storage.run_folder.picture_files import VideoFile

MAX_SIDE_PX = 640
_QUALITY = 27
_BUDGET_BYTES = 8_000_000
"""What a video takes at most, however much moves in it: base64 makes 10.7 MB of it."""
_MOST_BITS_S, _LEAST_BITS_S = 2_000_000, 200_000
"""A video of more than five minutes takes more than the budget, with 200 kbit/s."""


class EmbeddedVideo(ExitStack):
    """A small mp4 that is being written, as a context manager: all frames of a video, at the same times."""

    def __init__(self, path: Path, facts: VideoFacts, colors: Colors) -> None:
        super().__init__()
        self._size = width, height = planar_size(facts, MAX_SIDE_PX)
        self._image = np.empty((height * 3 // 2, width), np.uint8)
        seconds = max(facts.num_frames / max(facts.fps, 1.0), 1.0)
        bits_s = min(max(round(8 * _BUDGET_BYTES / seconds), _LEAST_BITS_S), _MOST_BITS_S)
        options = {"g": str(max(1, math.ceil(facts.fps))), "maxrate": str(bits_s), "bufsize": str(2 * bits_s)}
        self._file = self.enter_context(
            VideoFile(path, width=width, height=height, fps=facts.fps, colors=colors, quality=_QUALITY, options=options)
        )

    def add(self, time_s: float, planes: Planes) -> None:
        """Encode one more picture, of any size of even sides."""
        width, height = self._size
        half = width // 2, height // 2
        flat, at = self._image.reshape(-1), 0
        for plane, size in zip(planes, (self._size, half, half), strict=True):
            part = flat[at : at + size[0] * size[1]].reshape(size[::-1])
            cv2.resize(plane, size, dst=part, interpolation=cv2.INTER_AREA)
            at += part.size
        self._file.add(time_s, self._image)


def write_embedded(overlay: Path, target: Path) -> None:
    """Encode overlay.mp4 once more, small."""
    with overlay.open("rb") as stream:
        facts = read_facts(stream)
        planes = planar_frames(stream, facts, 0, facts.num_frames)
        with EmbeddedVideo(target, facts, read_colors(stream)) as video, prefetched(planes) as decoded:
            for frame in decoded:
                video.add(frame.time_s, frame.planes)
