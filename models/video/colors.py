"""What the samples of a video mean as colours, and colours as samples of such a video.

The overlay is drawn on the decoded planes themselves and encoded with the video's own tags: no picture passes through
RGB, so that its colours are exactly those of the video in every player.
"""

from dataclasses import dataclass
from typing import BinaryIO

import numpy as np
from av.video.codeccontext import VideoCodecContext
from av.video.frame import VideoFrame
from jaxtyping import Float, UInt8

from humanmm.models.video.container import open_video

_RGB_MATRIX = 0
_BT601 = (0.299, 0.114)
_LUMA_WEIGHTS = {1: (0.2126, 0.0722), 9: (0.2627, 0.0593), 10: (0.2627, 0.0593)}
"""Weights of red and blue in luma by matrix number (ITU-T H.273, table 4); all others are treated as BT.601."""


@dataclass(frozen=True)
class Colors:
    """A video's colour tags, numbered as in ITU-T H.273; 2 is unspecified. Samples are of limited range."""

    matrix: int = 6
    primaries: int = 6
    transfer: int = 6

    def samples(self, rgb: UInt8[np.ndarray, "*any 3"]) -> UInt8[np.ndarray, "*any 3"]:
        """Y, Cb and Cr of colours: black is 16, white 235, gray has 128 in both others."""
        red_weight, blue_weight = _LUMA_WEIGHTS.get(self.matrix, _BT601)
        red, green, blue = np.moveaxis(np.asarray(rgb, np.float64) / 255, -1, 0)
        luma = red_weight * red + (1 - red_weight - blue_weight) * green + blue_weight * blue
        planes = [
            16 + 219 * luma,
            128 + 112 * (blue - luma) / (1 - blue_weight),
            128 + 112 * (red - luma) / (1 - red_weight),
        ]
        return np.asarray(np.rint(np.stack(planes, axis=-1)), np.uint8)

    def to_rgb(self) -> Float[np.ndarray, "3 4"]:
        """The affine map from samples (Y, Cb, Cr) to red, green and blue of 0..255."""
        red_weight, blue_weight = _LUMA_WEIGHTS.get(self.matrix, _BT601)
        red, blue = 2 * (1 - red_weight), 2 * (1 - blue_weight)
        green_weight = 1 - red_weight - blue_weight
        linear = np.array(
            [[1, 0, red], [1, -blue * blue_weight / green_weight, -red * red_weight / green_weight], [1, blue, 0]]
        ) * (255 / np.array([219, 224, 224]))
        return np.column_stack([linear, -linear @ [16, 128, 128]])


BT601 = Colors()


def read_colors(stream: BinaryIO) -> Colors:
    """The colour tags of a video; pictures that are stored as RGB are converted by BT.601 and get its tags."""
    with open_video(stream) as (_, video):
        return BT601 if video.codec_context is None else colors_of(video.codec_context)


def colors_of(tagged: VideoCodecContext | VideoFrame) -> Colors:
    """The colour tags of a decoder, or of one of its pictures."""
    if tagged.colorspace == _RGB_MATRIX:
        return BT601
    return Colors(int(tagged.colorspace), int(tagged.color_primaries), int(tagged.color_trc))
