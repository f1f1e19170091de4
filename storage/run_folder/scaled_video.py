"""A video of another size from a short one, without cuts: there and back, over and over."""

import itertools
import math
import tempfile
from fractions import Fraction
from pathlib import Path

import av

from humanmm.errors import VideoError
from humanmm.storage.run_folder.looped_video import write_looped

_PRESET = {"preset": "veryfast", "crf": "23"}


def write_scaled(source: Path, target: Path, *, height: int, seconds: float) -> None:
    """The pictures of `source`, forwards and backwards in alternation until they last at least so long, as H.264 in a
    .mkv of `height` square pixels. As many as are needed are in memory once, in their own size."""
    with av.open(str(source)) as opened:
        if not opened.streams.video:
            raise VideoError(f"{source} holds no video stream")
        stream = opened.streams.video[0]
        rate = Fraction(stream.average_rate or 25)
        first = itertools.islice(opened.decode(stream), math.ceil(seconds * rate / 2))
        pictures = [frame.reformat(format="yuv420p") for frame in first]
        aspect = stream.sample_aspect_ratio or 1
    width = 2 * round(height * pictures[0].width * aspect / pictures[0].height / 2)
    with tempfile.TemporaryDirectory(prefix="humanmm-scaled-") as folder:
        once = Path(folder) / "once.mp4"  # which keeps the times of decoding
        with av.open(str(once), "w") as container:
            coded = container.add_stream("libx264", rate=rate, options=_PRESET)
            coded.width, coded.height, coded.pix_fmt = width, height, "yuv420p"
            for number, picture in enumerate((*pictures, *pictures[::-1])):
                fresh = picture.reformat(width=width, height=height)
                fresh.pts, fresh.time_base = number, 1 / rate
                container.mux(coded.encode(fresh))
            container.mux(coded.encode())
        write_looped(once, target, seconds=seconds)
