"""Pictures as files: png, and H.264 video that every player opens (mp4, 4:2:0, index in front, true times).

Video settings are chosen for speed: on one core a 720p picture takes about 4 ms to encode.
"""

from collections.abc import Iterable, Mapping
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
from jaxtyping import UInt8

from humanmm.models.video.colors import Colors

TIME_BASE = Fraction(1, 90_000)
"""Fine enough for every usual frame rate; variable rates stay exact to 6 µs."""

_FAST = {"preset": "ultrafast", "x264-params": "deblock=1,0,0:8x8dct=1:scenecut=40"}
"""On a 720p clip of one person 4.1 ms a frame, 0.55 MB/s, 43.4 dB; `superfast` takes 7.1 ms for 43.6 dB. The
filter against blocks and the large transform cost 0.2 ms and are worth 0.4 dB."""
_THREADS = 1
"""Fixed, not the number of cores: the bytes of x264 depend on it. Decoding and drawing have threads of their own."""
_LIMITED_RANGE = 1


class VideoFile:
    """An mp4 that is being written, as a context manager: `with VideoFile(path, …) as video: video.add(time_s, image)`.

    Pictures are yuv420p of even sides, the planes one after the other; they may be overwritten after `add`. Times, in
    seconds, rise; the first becomes zero. `quality` is x264's constant rate factor (lower is better), `options` are
    more of the encoder's options.
    """

    def __init__(
        self,
        path: Path,
        *,
        width: int,
        height: int,
        fps: float,
        colors: Colors,
        quality: int = 22,
        options: Mapping[str, str] = {},
    ) -> None:
        self._container = av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"})
        self._stream = self._container.add_stream("libx264", rate=Fraction(max(fps, 1.0)).limit_denominator(1001))
        self._stream.width, self._stream.height, self._stream.pix_fmt = width, height, "yuv420p"
        self._stream.options = {**_FAST, "crf": str(quality), **options}
        codec = self._stream.codec_context
        codec.time_base = TIME_BASE
        codec.thread_count = _THREADS
        codec.colorspace, codec.color_primaries, codec.color_trc = colors.matrix, colors.primaries, colors.transfer
        codec.color_range = _LIMITED_RANGE
        # the path without a copy misplaces the second plane of chroma that ends in the middle of a row
        self._to_frame = av.VideoFrame.from_ndarray if height % 4 else av.VideoFrame.from_numpy_buffer
        self._first: float | None = None

    def __enter__(self) -> "VideoFile":
        return self

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        try:
            if kind is None:
                self._container.mux(self._stream.encode(None))
        finally:
            self._container.close()

    def add(self, time_s: float, image: UInt8[np.ndarray, "HplusHalf W"]) -> None:
        """Encode one more picture."""
        self._first = time_s if self._first is None else self._first
        picture = self._to_frame(np.ascontiguousarray(image), format="yuv420p")
        picture.pts = round((time_s - self._first) / TIME_BASE)
        picture.time_base = TIME_BASE
        self._container.mux(self._stream.encode(picture))


def write_video(
    path: Path,
    pictures: Iterable[tuple[float, UInt8[np.ndarray, "HplusHalf W"]]],
    *,
    width: int,
    height: int,
    fps: float,
    colors: Colors,
    quality: int = 22,
) -> None:
    """Encode pictures with their times, as `VideoFile` takes them."""
    with VideoFile(path, width=width, height=height, fps=fps, colors=colors, quality=quality) as video:
        for time_s, image in pictures:
            video.add(time_s, image)


def write_png(path: Path, image: UInt8[np.ndarray, "H W 3"]) -> None:
    """Write an RGB picture."""
    _, data = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
    path.write_bytes(data.tobytes())
