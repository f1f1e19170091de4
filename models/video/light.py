"""How light the pictures of a video are, and what makes dark ones readable.

Detectors, pose networks and trackers of points are made for pictures whose lightest things are nearly white. In
pictures a third as light they lose people and points, though the eye still sees everything: one gain for all pictures
of a scene gives that back (docs/measurements/perception.md).
"""

import cv2
import numpy as np
from av.video.frame import VideoFrame
from jaxtyping import UInt8

from humanmm.models.records.video import VideoFacts
from humanmm.models.video.frames import luma, luma_is_gray

DARKER = 0.98
"""The part of a picture's pixels that are darker than what is called its light."""
SHOWN = 0.9
"""The part of a span's pictures that are no lighter than what is called the light of the span."""
LIT = 180.0
"""Grey levels, the light that dark pictures get."""
LEAST, MOST = 1.25, 8.0
"""A smaller gain changes nothing worth its time, and a larger one shows the coder's blocks."""
_STEP = 8
"""One of so many rows and columns is looked at."""
_SMALL = 160
"""Width of a picture of another format when it is looked at."""


def light_of(picture: VideoFrame) -> int:
    """The grey level 0..255 below which DARKER of a decoded picture's pixels lie."""
    if not luma_is_gray(picture):
        height = max(1, round(_SMALL * picture.height / picture.width))
        picture = picture.reformat(width=_SMALL, height=height, format="gray")
    counts = np.cumsum(np.bincount(luma(picture, step=_STEP).ravel(), minlength=256))
    return int(np.searchsorted(counts, DARKER * counts[-1]))


def gain_of(facts: VideoFacts, start: int, end: int, *, shown: float = SHOWN) -> float:
    """What the grey levels of frames [start, end) are multiplied by, so that detectors and networks see what is in
    them; 1 of pictures that are light enough, or of which nothing is known.

    A part `shown` of them is no lighter than LIT then.
    """
    if facts.light is None or start >= end:
        return 1.0
    gain = min(LIT / max(1.0, float(np.quantile(facts.light[start:end], shown))), MOST)
    return gain if gain >= LEAST else 1.0


def brightened(image: UInt8[np.ndarray, "*shape"], gain: float) -> UInt8[np.ndarray, "*shape"]:
    """A picture of grey levels or colours, as light as that."""
    return image if gain == 1.0 else np.asarray(cv2.convertScaleAbs(image, alpha=gain))
