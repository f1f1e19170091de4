"""The video inside the page: the overlay again, small, and with a keyframe for every second, for quick jumps."""

import math
from pathlib import Path

from humanmm.models.video.colors import read_colors
from humanmm.models.video.frames import joined, planar_frames, planar_size
from humanmm.models.video.prefetch import prefetched
from humanmm.models.video.reading import read_facts
from humanmm.storage.run_folder.picture_files import write_video

MAX_SIDE_PX = 640
_QUALITY = 27
_BUDGET_BYTES = 8_000_000
"""What a video takes at most, however much moves in it: base64 makes 10.7 MB of it."""
_MOST_BITS_S, _LEAST_BITS_S = 2_000_000, 200_000
"""A video of more than five minutes takes more than the budget, with 200 kbit/s."""


def write_embedded(overlay: Path, target: Path) -> None:
    """Encode overlay.mp4 again: all frames, at the same times, at most MAX_SIDE_PX wide and high."""
    with overlay.open("rb") as stream:
        facts = read_facts(stream)
        colors = read_colors(stream)
        width, height = planar_size(facts, MAX_SIDE_PX)
        seconds = max(facts.num_frames / max(facts.fps, 1.0), 1.0)
        bits_s = min(max(round(8 * _BUDGET_BYTES / seconds), _LEAST_BITS_S), _MOST_BITS_S)
        planes = planar_frames(stream, facts, 0, facts.num_frames, max_side_px=MAX_SIDE_PX)
        with prefetched((frame.time_s, joined(frame.planes)) for frame in planes) as pictures:
            write_video(
                target,
                pictures,
                width=width,
                height=height,
                fps=facts.fps,
                colors=colors,
                quality=_QUALITY,
                options={"g": str(max(1, math.ceil(facts.fps))), "maxrate": str(bits_s), "bufsize": str(2 * bits_s)},
            )
