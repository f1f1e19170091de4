"""A decoded picture as the networks see it: luma and half as fine chroma; RGB only of the parts they look at.

Converting every picture whole costs as much as decoding it, most of it for fresh memory that is thrown away.
"""

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from humanmm.models.perception.regions import Region, warp
from humanmm.models.video.colors import BT601, Colors
from humanmm.models.video.frames import Planes
from humanmm.models.video.light import brightened

_BLACK, _NO_COLOR = 16, 128


class Picture:
    """One 4:2:0 picture of even sides. Positions are pixels of the whole picture, centres at .5."""

    def __init__(self, planes: Planes, colors: Colors = BT601, gain: float = 1.0) -> None:
        self.planes = planes
        self.colors = colors
        self.gain = gain
        """What `crop`, `warped` and `reduced` multiply the light by, for networks that see badly in the dark."""
        self.height, self.width = planes[0].shape

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        return self.width, self.height

    @property
    def as_filmed(self) -> "Picture":
        """The same in its own light, for colours that are compared with those of other scenes."""
        return Picture(self.planes, self.colors)

    def copy(self) -> "Picture":
        """A picture of its own, that may be painted on."""
        y, cb, cr = self.planes
        return Picture((y.copy(), cb.copy(), cr.copy()), self.colors, self.gain)

    def part(self, low: Float[np.ndarray, " 2"], high: Float[np.ndarray, " 2"]) -> "tuple[Picture, np.ndarray]":
        """The pixels from corner low to corner high, rounded to even ones, not copied, and where they begin."""
        (left, top), (right, bottom) = (np.round(np.asarray(corner) / 2).astype(int) for corner in (low, high))
        y, cb, cr = self.planes
        planes = (
            y[2 * top : 2 * bottom, 2 * left : 2 * right],
            cb[top:bottom, left:right],
            cr[top:bottom, left:right],
        )
        return Picture(planes, self.colors, self.gain), np.array([2.0 * left, 2.0 * top])

    def warped(
        self, target_to_source: Float[np.ndarray, "2 3"], size: tuple[int, int]
    ) -> UInt8[np.ndarray, "height width 3"]:
        """RGB picture of size (width, height) whose pixel p shows target_to_source(p); black outside."""
        to_chroma = 0.5 * target_to_source
        y, cb, cr = self.planes
        samples = (
            warp(y, target_to_source, size, border=_BLACK),
            warp(cb, to_chroma, size, border=_NO_COLOR),
            warp(cr, to_chroma, size, border=_NO_COLOR),
        )
        return self._rgb(samples)

    def crop(self, region: Region, size: int) -> UInt8[np.ndarray, "size size 3"]:
        """The region as size × size RGB pixels, black outside the picture."""
        return self.warped(region.to_source(size), (size, size))

    def reduced(self, scale: float) -> UInt8[np.ndarray, "height width 3"]:
        """The whole picture in RGB, `scale` ≤ 1 times as large."""
        size = max(1, round(scale * self.width)), max(1, round(scale * self.height))
        return self._rgb([cv2.resize(plane, size, interpolation=cv2.INTER_AREA) for plane in self.planes])

    def paint(self, x: int, y: int, covered: UInt8[np.ndarray, "h w"], gray: int) -> None:
        """Fill what `covered` does not leave zero with what networks see as a grey (0..255), its corner at (x, y); all
        four are even."""
        half = cv2.resize(covered, (covered.shape[1] // 2, covered.shape[0] // 2), interpolation=cv2.INTER_NEAREST)
        luma = int(self.colors.samples(np.full(3, gray / self.gain, np.uint8))[0])
        for plane, mask, fine, value in zip(
            self.planes, (covered, half, half), (1, 2, 2), (luma, _NO_COLOR, _NO_COLOR), strict=True
        ):
            part = plane[y // fine : y // fine + mask.shape[0], x // fine : x // fine + mask.shape[1]]
            cv2.copyTo(np.full(part.shape, value, np.uint8), mask, part)

    def _rgb(self, samples: "list[np.ndarray] | Planes") -> UInt8[np.ndarray, "height width 3"]:
        return brightened(np.asarray(cv2.transform(cv2.merge(list(samples)), self.colors.to_rgb())), self.gain)


def whole(picture: Picture) -> Region:
    """The smallest upright square that holds the picture."""
    return Region(picture.width / 2, picture.height / 2, float(max(picture.size)))
