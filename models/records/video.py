"""What is known of a video once every frame has been found to decode."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

Size = tuple[int, int]
"""Width and height."""
Field = Literal["top", "bottom"]
"""Rows of an interlaced picture: the even ones, the first included, or the odd ones."""


@dataclass(frozen=True)
class PictureSizes:
    """Sizes of a video's upright pictures: as they are delivered, and as they are stored.

    Programs that read with OpenCV, and the png files of ffmpeg, have the pixels that are stored, turned upright. The
    two sizes differ where those pixels are not square.
    """

    square: Size
    """Pixels of everything here."""
    coded: Size

    @property
    def to_square(self) -> np.ndarray:
        """(2,) what x and y of a coded picture are multiplied by; exactly 1 where its pixels are square."""
        return np.array(self.square, np.float64) / self.coded

    @property
    def text(self) -> str:
        """The size that other programs see, and what is to be known of it: for messages."""
        width, height = self.coded
        return f"{width}×{height}" + ("" if self.coded == self.square else " as stored, in pixels that are not square")

    def like(self, width: float, height: float, *, within: float) -> Size | None:
        """Of the two sizes the one with the proportion of width to height; None if both are off by more than
        `within`, a fraction."""
        off = {size: abs(width / height * size[1] / size[0] - 1) for size in (self.square, self.coded)}
        nearest = min(off, key=lambda size: off[size])
        return nearest if off[nearest] <= within else None

    def squared(self, K: np.ndarray, seen: Size) -> np.ndarray:
        """(n,3,3) intrinsics of pictures of size `seen`, in square pixels."""
        factor = np.array(self.square, np.float64) / seen
        return np.asarray(K * np.array([factor[0], factor[1], 1.0])[:, None])


@dataclass(frozen=True)
class VideoFacts:
    """Container facts and exact frame times. Width and height belong to the picture as it is delivered: upright
    (rotation applied), of square pixels."""

    width: int
    height: int
    time_s: np.ndarray
    """(F,) float64, presentation time of each decodable frame, first frame's own time kept, strictly increasing."""
    keyframe: np.ndarray
    """(F,) bool, true where decoding can start."""
    rotation_deg: int
    """Clockwise rotation that makes the stored picture upright: 0, 90, 180, 270."""
    codec: str
    container: str
    warnings: tuple[str, ...] = ()
    """One sentence each, e.g. for a truncated file."""
    mirrored: bool = False
    """The stored picture is also flipped left to right, before the rotation."""
    counted: bool = False
    """Time stamps do not name the pictures (AVI with B-frames): frames are found by counting from the first."""
    coded_size: Size | None = None
    """Width and height of the picture as it is stored, before its rotation; None: those of the delivered picture."""
    sample_aspect_ratio: tuple[int, int] = (1, 1)
    """Width to height of a stored pixel, before the rotation; what the decoder makes square."""
    first_field: Field | None = None
    """Of an interlaced video, the field that comes first: each picture is delivered as that one shows it."""
    light: np.ndarray | None = None
    """(F,) uint8, the grey level below which nearly all of a frame lies (`models.video.light`); None: not known."""

    @property
    def sizes(self) -> PictureSizes:
        """Of the upright pictures, in square pixels and in those that are stored."""
        delivered = self.width, self.height
        if self.coded_size is None:
            return PictureSizes(delivered, delivered)
        return PictureSizes(delivered, self.coded_size[::-1] if self.rotation_deg in (90, 270) else self.coded_size)

    @property
    def interlaced(self) -> bool:
        """Whether the stored pictures are woven from two moments."""
        return self.first_field is not None

    @property
    def num_frames(self) -> int:
        return len(self.time_s)

    @property
    def fps(self) -> float:
        """Mean frame rate, Hz; 0 for a single frame."""
        return mean_rate_hz(self.time_s)


def mean_rate_hz(time_s: np.ndarray) -> float:
    """(F − 1) / (last time − first time) of F frame times, Hz; 0 for a single frame."""
    span = float(time_s[-1] - time_s[0]) if len(time_s) > 1 else 0.0
    return (len(time_s) - 1) / span if span > 0 else 0.0
