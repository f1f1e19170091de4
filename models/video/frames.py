"""Frames on demand: decoded again whenever a stage needs them, never stored.

`frames(stream, facts, start, stop)` delivers exactly the announced frames of [start, stop), upright, in square pixels
(`square_pixels`) and of one moment each (`fields`), one at a time;
`planar_frames` the same as the decoder has them, luma and chroma apart, without converting or copying; `frames_at`
chosen ones, and jumps from keyframe to keyframe over what lies between. Decoding enters at the last
keyframe before a frame; should the decoder not deliver the frame from there (a container that seeks past it, references
lost at an open group of pictures) it enters one keyframe earlier, at worst at the beginning.
"""

from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from itertools import pairwise
from typing import BinaryIO, Literal, TypeVar

import cv2
import numpy as np
from av.video.frame import VideoFrame
from av.video.plane import VideoPlane
from av.video.reformatter import ColorRange, Interpolation, VideoReformatter
from av.video.stream import VideoStream
from jaxtyping import UInt8

from humanmm.errors import VideoError
from humanmm.models.records.video import VideoFacts
from humanmm.models.video.colors import Colors, colors_of
from humanmm.models.video.container import PacketLog, decoded, open_video
from humanmm.models.video.fields import one_field, rows_of, whole

T = TypeVar("T")

Pixels = Literal["rgb", "bgr", "gray"]
_FORMATS = {"rgb": "rgb24", "bgr": "bgr24", "gray": "gray"}

_ROTATIONS = {90: cv2.ROTATE_90_CLOCKWISE, 180: cv2.ROTATE_180, 270: cv2.ROTATE_90_COUNTERCLOCKWISE}

_LUMA_TO_GRAY = np.clip(np.round((np.arange(256) - 16) * (255 / 219)), 0, 255).astype(np.uint8)
"""Limited-range luma (16 black, 235 white) to 0..255."""
_LUMA_FORMATS = ("yuv420p", "yuv422p", "yuv444p", "nv12", "gray")
_FULL_RANGE_FORMATS = ("yuvj420p", "yuvj422p", "yuvj444p")


@dataclass(frozen=True)
class Frame:
    """One upright picture of the video."""

    index: int
    time_s: float
    image: np.ndarray
    """(H,W,3) uint8 for rgb and bgr, (H,W) uint8 for gray; valid as long as it is referenced; do not write into it."""


Planes = tuple[UInt8[np.ndarray, "H W"], UInt8[np.ndarray, "H/2 W/2"], UInt8[np.ndarray, "H/2 W/2"]]
"""Y, Cb and Cr of a picture of even sides, limited range, in the video's own matrix."""


@dataclass(frozen=True)
class PlanarFrame:
    """One upright 4:2:0 picture of the video."""

    index: int
    time_s: float
    planes: Planes
    """Mostly the decoder's own memory: valid as long as they are referenced; do not write into them."""
    colors: Colors
    """What the samples mean."""


def joined(planes: Planes, out: UInt8[np.ndarray, "3H/2 W"] | None = None) -> UInt8[np.ndarray, "3H/2 W"]:
    """A copy with the planes one after the other, as encoders take them and OpenCV calls I420.

    A stream of pictures should go through a few arrays `out`: fresh memory for each takes longer than the copying.
    """
    height, width = planes[0].shape
    out = np.empty((height * 3 // 2, width), np.uint8) if out is None else out
    np.concatenate([plane.reshape(-1) for plane in planes], out=out.reshape(-1))
    return out


def scaled_size(facts: VideoFacts, max_side_px: int | None) -> tuple[int, int]:
    """Width and height of the pictures that `frames` delivers for this max_side_px: never enlarged, aspect kept."""
    largest = max(facts.width, facts.height)
    if max_side_px is None or largest <= max_side_px:
        return facts.width, facts.height
    scale = max_side_px / largest
    return max(1, round(facts.width * scale)), max(1, round(facts.height * scale))


def planar_size(facts: VideoFacts, max_side_px: int | None) -> tuple[int, int]:
    """Width and height of planar frames: as `scaled_size`, the next smaller even numbers."""
    width, height = scaled_size(facts, max_side_px)
    return max(2, width // 2 * 2), max(2, height // 2 * 2)


def frames(
    stream: BinaryIO,
    facts: VideoFacts,
    start: int = 0,
    stop: int | None = None,
    *,
    pixels: Pixels = "rgb",
    max_side_px: int | None = None,
) -> Iterator[Frame]:
    """Frames [start, stop) of the video in presentation order, one at a time, at most max_side_px wide and high.

    A position x in a scaled picture is x · facts.width / scaled width in the source (pixel centres at .5 in both).
    """
    stop = facts.num_frames if stop is None else stop
    if not 0 <= start <= stop <= facts.num_frames:
        raise ValueError(f"frames [{start}, {stop}) of a video of {facts.num_frames}")
    return frames_at(stream, facts, range(start, stop), pixels=pixels, max_side_px=max_side_px)


def frames_at(
    stream: BinaryIO,
    facts: VideoFacts,
    wanted: Sequence[int],
    *,
    pixels: Pixels = "rgb",
    max_side_px: int | None = None,
) -> Iterator[Frame]:
    """The frames with these numbers, which rise, as `frames` delivers them."""
    convert = _Conversion(facts, scaled_size(facts, max_side_px))
    for index, image in _chosen(stream, facts, wanted, lambda picture: convert.image(picture, pixels)):
        yield Frame(index, float(facts.time_s[index]), image)


def planar_frames(
    stream: BinaryIO, facts: VideoFacts, start: int, stop: int, *, max_side_px: int | None = None
) -> Iterator[PlanarFrame]:
    """Frames [start, stop) as `frames` delivers them, in planes of `planar_size`."""
    convert = _Conversion(facts, planar_size(facts, max_side_px))
    planar = _chosen(stream, facts, range(start, stop), lambda picture: (convert.planes(picture), colors_of(picture)))
    for index, (planes, colors) in planar:
        yield PlanarFrame(index, float(facts.time_s[index]), planes, colors)


def _chosen(
    stream: BinaryIO, facts: VideoFacts, wanted: Sequence[int], convert: Callable[[VideoFrame], T]
) -> Iterator[tuple[int, T]]:
    entries = np.flatnonzero(facts.keyframe)
    entry_of = entries[np.searchsorted(entries, wanted, side="right") - 1]
    # a new pass begins where entering anew spares the decoder frames
    begins = [k for k in range(len(wanted)) if k == 0 or entry_of[k] > wanted[k - 1] + 1]
    for begin, end in pairwise([*begins, len(wanted)]):
        for index, picture in _one_pass(stream, facts, wanted[begin:end], int(entry_of[begin])):
            yield index, convert(picture)


def _one_pass(
    stream: BinaryIO, facts: VideoFacts, wanted: Sequence[int], entry: int
) -> Iterator[tuple[int, VideoFrame]]:
    """Index and picture of the wanted frames, decoded from a keyframe on, or from one before where that fails."""
    done = 0
    while True:
        with closing(_from_keyframe(stream, facts, entry)) as pictures:
            for position, picture in pictures:
                if position > wanted[done]:
                    break
                if position == wanted[done]:
                    yield position, picture
                    done += 1
                    if done == len(wanted):
                        return
        if entry == 0:
            raise VideoError(
                f"frame {wanted[done]} was decoded when the video was first read, but not now: the file is damaged, so "
                "that each pass gives other pictures, or it was changed meanwhile; give an intact copy, or one that is "
                "encoded anew (`ffmpeg -i FILE -c:v libx264 -crf 16 NEW.mp4`)"
            )
        entry = int(np.flatnonzero(facts.keyframe[:entry])[-1])


def _from_keyframe(stream: BinaryIO, facts: VideoFacts, entry: int) -> Generator[tuple[int, VideoFrame], None, None]:
    """Index and picture of the announced frames from keyframe `entry` on; `entry` 0 is the beginning of the file."""
    with open_video(stream) as (container, video):
        if facts.counted:
            yield from enumerate(decoded(container, video, PacketLog()))
            return
        index_of = {p: i for i, p in enumerate(_pts(facts, video))}
        if entry > 0:
            container.seek(_pts(facts, video)[entry], stream=video)
        last = -1
        for picture in decoded(container, video, PacketLog()):
            index = index_of.get(picture.pts if picture.pts is not None else -1, -1)
            if index > last:
                last = index
                yield index, picture


def _pts(facts: VideoFacts, video: VideoStream) -> list[int]:
    """Time stamps of the announced frames in the stream's own unit (float64 seconds hold them exactly)."""
    if video.time_base is None:
        raise VideoError("the video stream has lost its time base; if the file was changed meanwhile, run again")
    ticks_per_s = float(1 / video.time_base)
    return [int(t) for t in np.rint(facts.time_s * ticks_per_s).astype(np.int64)]


class _Conversion:
    """Turns decoded pictures into upright arrays of one size (width, height)."""

    def __init__(self, facts: VideoFacts, size: tuple[int, int]) -> None:
        self._size = size[::-1] if facts.rotation_deg in (90, 270) else size
        self._rotation = _ROTATIONS.get(facts.rotation_deg)
        self._mirrored = facts.mirrored
        self._first_field = facts.first_field
        self._has_square_pixels = facts.sample_aspect_ratio == (1, 1)
        self._reformatter = VideoReformatter()

    def image(self, picture: VideoFrame, pixels: Pixels) -> np.ndarray:
        """As `Frame.image`."""
        picture = self._of_one_moment(picture)
        if pixels == "gray" and luma_is_gray(picture) and self._has_square_pixels:
            image = luma(picture)
            if (picture.width, picture.height) != self._size:
                image = cv2.resize(image, self._size, interpolation=cv2.INTER_AREA)
        else:
            image = self._reformatted(picture, pixels)
        return self._upright(image)

    def _of_one_moment(self, picture: VideoFrame) -> VideoFrame:
        return picture if self._first_field is None else one_field(picture, self._first_field)

    def _upright(self, image: np.ndarray) -> np.ndarray:
        if self._mirrored:
            image = cv2.flip(image, 1)
        if self._rotation is not None:
            image = cv2.rotate(image, self._rotation)
        return image

    def planes(self, picture: VideoFrame) -> Planes:
        """As they were decoded, or converted if the video is stored differently."""
        picture = self._of_one_moment(picture)
        width, height = self._size
        full_range = picture.format.name in _FULL_RANGE_FORMATS or picture.color_range == ColorRange.JPEG
        if picture.format.name != "yuv420p" or (picture.width, picture.height) != self._size or full_range:
            picture = self._converted(picture, "yuv420p", ColorRange.MPEG)
        sizes = ((width, height), (width // 2, height // 2), (width // 2, height // 2))
        y, cb, cr = (self._upright(_rows(plane, *size)) for plane, size in zip(picture.planes, sizes, strict=True))
        return y, cb, cr

    def _reformatted(self, picture: VideoFrame, pixels: Pixels) -> np.ndarray:
        width, height = self._size
        channels = 1 if pixels == "gray" else 3
        rows = _rows(self._converted(picture, _FORMATS[pixels]).planes[0], width * channels, height)
        return rows if channels == 1 else rows.reshape(height, width, channels)

    def _converted(self, picture: VideoFrame, pixel_format: str, color_range: ColorRange | None = None) -> VideoFrame:
        width, height = self._size
        # a side that grows while the other one shrinks is interpolated linearly by swscale's AREA
        shrinks = width < picture.width or height < picture.height
        return self._reformatter.reformat(
            whole(picture) if picture.interlaced_frame else picture,
            width=width,
            height=height,
            format=pixel_format,
            dst_color_range=color_range,
            interpolation=Interpolation.AREA if shrinks else Interpolation.BICUBIC,
        )


def luma_is_gray(picture: VideoFrame) -> bool:
    """Whether a decoded picture has a plane of luma, one byte a pixel."""
    return picture.format.name in _LUMA_FORMATS + _FULL_RANGE_FORMATS


def luma(picture: VideoFrame, *, step: int = 1) -> np.ndarray:
    """The luma plane (every step-th row and column of it) as gray values 0..255, without a conversion of colours."""
    rows = _rows(picture.planes[0], picture.width, picture.height)
    rows = rows if step == 1 else np.ascontiguousarray(rows[::step, ::step])
    full_range = picture.format.name in (*_FULL_RANGE_FORMATS, "gray") or picture.color_range == ColorRange.JPEG
    return rows if full_range else np.asarray(cv2.LUT(rows, _LUMA_TO_GRAY))


def _rows(plane: VideoPlane, row_bytes: int, height: int) -> np.ndarray:
    """A plane as (height, row_bytes) uint8, sharing the picture's memory, without the padding of rows."""
    return rows_of(plane)[:height, :row_bytes]
