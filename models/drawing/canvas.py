"""A video picture that can be drawn on: planes of luma and half as fine chroma, as a decoder delivers them.

Drawing there costs half of what it costs in RGB, and saves converting every picture twice. All positions are pixels of
the whole picture, rectangles are [x0, x1) × [y0, y1), and what lies outside is cut off.
"""

from collections.abc import Sequence
from functools import lru_cache

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from humanmm.models.drawing.palette import RGB
from humanmm.models.video.colors import Colors
from humanmm.models.video.frames import Planes

_SHIFT = 4
"""Fractional bits of the corners of polygons."""
_FINENESS = (1, 2, 2)
"""Pixels a sample of Y, Cb, Cr is wide and high."""


class Canvas:
    """One 4:2:0 picture, drawn on in place."""

    def __init__(self, image: UInt8[np.ndarray, "HplusHalf W"], colors: Colors) -> None:
        """`image`: even sides, planes Y, Cb, Cr one after the other."""
        self.height, self.width = image.shape[0] * 2 // 3, image.shape[1]
        self.colors = colors
        luma, chroma = self.height * self.width, self.height * self.width // 4
        half = self.height // 2, self.width // 2
        flat = image.reshape(-1)
        self._planes = (
            flat[:luma].reshape(self.height, self.width),
            flat[luma : luma + chroma].reshape(half),
            flat[luma + chroma :].reshape(half),
        )

    def rectangle(self, x0: int, y0: int, x1: int, y1: int, color: RGB, opacity: float = 1.0) -> None:
        """Fill a rectangle, or tint it."""
        x0, y0, x1, y1 = max(x0, 0), max(y0, 0), min(x1, self.width), min(y1, self.height)
        if x0 >= x1 or y0 >= y1:
            return
        for plane, sample, fine in zip(self._planes, _samples(self.colors, color), _FINENESS, strict=True):
            part = plane[y0 // fine : -(-y1 // fine), x0 // fine : -(-x1 // fine)]
            if opacity == 1.0:
                part[...] = sample
            else:
                cv2.addWeighted(part, 1 - opacity, part, 0.0, opacity * sample, dst=part)

    def border(self, thickness: int, color: RGB) -> None:
        """Fill the edge of the picture."""
        width, height = self.width, self.height
        self.rectangle(0, 0, width, thickness, color)
        self.rectangle(0, height - thickness, width, height, color)
        self.rectangle(0, thickness, thickness, height - thickness, color)
        self.rectangle(width - thickness, thickness, width, height - thickness, color)

    def polygon(self, points: Float[np.ndarray, "P 2"], color: RGB, outline: RGB | None = None) -> None:
        """Fill a convex polygon with soft edges, and draw its outline one pixel wide."""
        line = color if outline is None else outline
        samples = zip(_samples(self.colors, color), _samples(self.colors, line), strict=True)
        for plane, (inside, edge), fine in zip(self._planes, samples, _FINENESS, strict=True):
            corners = np.rint((points / fine - 0.5) * (1 << _SHIFT)).astype(np.int32)
            cv2.fillConvexPoly(plane, corners, inside, cv2.LINE_AA, _SHIFT)
            if outline is not None:
                cv2.polylines(plane, [corners], True, edge, 1, cv2.LINE_AA, _SHIFT)

    def lines(self, lines: Sequence[Float[np.ndarray, "P 2"]], color: RGB, thickness: int = 1) -> None:
        """Draw lines from point to point, with soft edges."""
        for plane, sample, fine in zip(self._planes, _samples(self.colors, color), _FINENESS, strict=True):
            points = [np.rint((line / fine - 0.5) * (1 << _SHIFT)).astype(np.int32) for line in lines]
            cv2.polylines(plane, points, False, sample, max(1, thickness // fine), cv2.LINE_AA, _SHIFT)

    def put(self, x: int, y: int, planes: Planes) -> None:
        """Put a whole picture of even sides with its upper left corner at (x, y), both even."""
        for plane, part, fine in zip(self._planes, planes, _FINENESS, strict=True):
            height, width = part.shape
            plane[y // fine : y // fine + height, x // fine : x // fine + width] = part

    @property
    def planes(self) -> Planes:
        """Y, Cb and Cr, to be drawn on."""
        return self._planes

    def stamp(self, x: int, y: int, mask: UInt8[np.ndarray, "h w"], color: RGB) -> None:
        """Paint with the coverage 0..255 that `mask` gives, its upper left corner at (x, y)."""
        left, top = max(-x, 0), max(-y, 0)
        mask = mask[top : max(self.height - y, 0), left : max(self.width - x, 0)]
        if mask.size == 0:
            return
        x, y = x + left, y + top
        height, width = mask.shape
        even = np.zeros((-(-(y % 2 + height) // 2) * 2, -(-(x % 2 + width) // 2) * 2), np.uint8)
        even[y % 2 : y % 2 + height, x % 2 : x % 2 + width] = mask
        half = _halved(even)
        for plane, sample, fine in zip(self._planes, _samples(self.colors, color), _FINENESS, strict=True):
            alpha = (even if fine == 1 else half).astype(np.int32)
            part = plane[y // 2 * 2 // fine :, x // 2 * 2 // fine :][: alpha.shape[0], : alpha.shape[1]]
            part[...] = part + (sample - part.astype(np.int32)) * alpha // 255

    def paste(self, y: int, picture: UInt8[np.ndarray, "h W 3"]) -> None:
        """Put samples (Y, Cb, Cr) of the picture's width over its rows from y on; y and h are even."""
        height = len(picture)
        for index, (plane, fine) in enumerate(zip(self._planes, _FINENESS, strict=True)):
            plane[y // fine : (y + height) // fine] = picture[::fine, ::fine, index]

    def surface(
        self,
        x: int,
        y: int,
        shade: UInt8[np.ndarray, "h w"],
        weight: Float[np.ndarray, "h w"],
        ramp: UInt8[np.ndarray, "256 3"],
    ) -> None:
        """Blend a shaded surface over the picture: samples (Y, Cb, Cr) by light, opacity 0..1. All sides are even."""
        half = np.maximum(shade[:, ::2], shade[:, 1::2])
        half = np.maximum(half[::2], half[1::2])  # not the mean: the background's shade is 0
        shades, weights = (shade, half, half), (weight, (half_weight := _halved(weight)), half_weight)
        rests = (1 - weight, (half_rest := 1 - half_weight), half_rest)
        for index, (plane, fine) in enumerate(zip(self._planes, _FINENESS, strict=True)):
            height, width = shades[index].shape
            part = plane[y // fine : y // fine + height, x // fine : x // fine + width]
            color = cv2.LUT(shades[index], ramp[:, index])
            cv2.blendLinear(color, part, weights[index], rests[index], dst=part)


def _halved(mask: np.ndarray) -> np.ndarray:
    """Means of 2 × 2 pixels."""
    return np.asarray(cv2.resize(mask, (mask.shape[1] // 2, mask.shape[0] // 2), interpolation=cv2.INTER_AREA))


@lru_cache(maxsize=64)
def _samples(colors: Colors, color: RGB) -> tuple[int, int, int]:
    y, cb, cr = colors.samples(np.array(color, np.uint8)).tolist()
    return y, cb, cr
