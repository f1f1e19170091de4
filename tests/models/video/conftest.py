"""Tiny clips made on the spot: every picture carries its own number as a row of black and white blocks."""

import io
from collections.abc import Callable, Sequence
from fractions import Fraction

import av
import numpy as np
import pytest

WIDTH, HEIGHT, BLOCK, BITS = 128, 96, 16, 8


def numbered_picture(number: int, width: int = WIDTH, height: int = HEIGHT) -> np.ndarray:
    """A gray picture whose top row of blocks spells the number in binary, above a gradient."""
    picture = np.empty((height, width, 3), np.uint8)
    picture[:] = np.linspace(40, 200, width, dtype=np.uint8)[None, :, None]
    for bit in range(BITS):
        white = number >> bit & 1
        picture[:BLOCK, bit * BLOCK : (bit + 1) * BLOCK] = 235 if white else 20
    return picture


def read_number(image: np.ndarray) -> int:
    """The number in a picture, whatever its size and channels."""
    gray = image if image.ndim == 2 else image.mean(axis=2)
    scale = gray.shape[1] / WIDTH
    row = int(BLOCK * scale / 2)
    return sum(int(gray[row, int((bit + 0.5) * BLOCK * scale)] > 128) << bit for bit in range(BITS))


def encode(
    container: str = "mp4",
    codec: str = "libx264",
    *,
    num_frames: int = 60,
    times: Sequence[int] | None = None,
    time_base: Fraction = Fraction(1, 1000),
    pix_fmt: str = "yuv420p",
    options: dict[str, str] | None = None,
    rotation_deg: int | None = None,
    sample_aspect_ratio: Fraction | None = None,
    pictures: Sequence[np.ndarray] | None = None,
    full_range: bool = False,
    container_options: dict[str, str] | None = None,
) -> io.BytesIO:
    """A clip of numbered pictures; `times` are presentation times in time_base units (40 ms steps by default)."""
    try:
        av.codec.Codec(codec, "w")
    except av.codec.codec.UnknownCodecError:
        pytest.skip(f"this build of PyAV has no encoder {codec}")
    if times is None:
        times = [40 * i for i in range(num_frames)]
    if pictures is None:
        pictures = [numbered_picture(i) for i in range(len(times))]
    file = io.BytesIO()
    with av.open(file, "w", format=container, container_options=container_options or {}) as out:
        stream = out.add_stream(codec, rate=25, options=dict(options or {}))
        stream.height, stream.width = pictures[0].shape[:2]
        stream.pix_fmt = pix_fmt
        stream.codec_context.time_base = time_base if container != "avi" else Fraction(1, 25)
        if full_range:
            stream.codec_context.color_range = av.video.reformatter.ColorRange.JPEG
        if sample_aspect_ratio is not None:
            stream.codec_context.sample_aspect_ratio = sample_aspect_ratio
        if rotation_deg is not None:
            stream.set_display_rotation(rotation_deg)
        for time, picture in zip(times, pictures, strict=True):
            frame = av.VideoFrame.from_ndarray(picture, "rgb24").reformat(
                format=pix_fmt, dst_color_range="JPEG" if full_range else "MPEG"
            )
            frame.pts = time if container != "avi" else time // 40
            frame.time_base = stream.codec_context.time_base
            out.mux(stream.encode(frame))
        out.mux(stream.encode(None))
    file.seek(0)
    return file


@pytest.fixture
def clip() -> Callable[..., io.BytesIO]:
    return encode


@pytest.fixture
def number_of() -> Callable[[np.ndarray], int]:
    return read_number


@pytest.fixture
def numbered() -> Callable[..., np.ndarray]:
    return numbered_picture
