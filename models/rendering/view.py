"""A camera at one instant, and the picture that is drawn for it: colours, depth, and what every pixel shows.

Coordinates are continuous pixels, the first pixel's centre at .5.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8

from humanmm.models.drawing.rasteriser import clip_polygon

Array = np.ndarray

NEAR_M = 0.08
SKY, FLOOR, BLOCK, FIRST_PERSON = 0, 1, 2, 3
"""What a pixel shows; people count from FIRST_PERSON."""
_MARGIN_PX = 8.0
"""Polygons are cut so far outside the picture."""

Box = tuple[int, int, int, int]


@dataclass(frozen=True, eq=False)
class View:
    """A camera at one instant."""

    R_world_cam: Float[Array, "3 3"]
    t_world_cam: Float[Array, "3"]
    K: Float[Array, "3 3"]
    width: int
    height: int

    def to_camera(self, points: Float[Array, "*n 3"]) -> Float[Array, "*n 3"]:
        """World points in camera axes."""
        return np.asarray((points - self.t_world_cam) @ self.R_world_cam)

    def project(self, in_camera: Float[Array, "*n 3"]) -> Float[Array, "*n 2"]:
        """Pixels of points in front of the camera."""
        projected = in_camera @ self.K.T
        return np.asarray(projected[..., :2] / projected[..., 2:])

    def outline(self, corners: Float[Array, "n 3"]) -> Float[Array, "m 2"] | None:
        """Pixels of the visible part of a convex polygon in the world; None if nothing of it is in view."""
        polygon = self.to_camera(corners)
        f, (cx, cy) = np.array([self.K[0, 0], self.K[1, 1]]), self.K[:2, 2]
        planes = (
            (0, 0, 1, -NEAR_M),
            (f[0], 0, cx + _MARGIN_PX, 0),
            (-f[0], 0, self.width + _MARGIN_PX - cx, 0),
            (0, f[1], cy + _MARGIN_PX, 0),
            (0, -f[1], self.height + _MARGIN_PX - cy, 0),
        )
        distances = polygon @ np.array([plane[:3] for plane in planes]).T + np.array([plane[3] for plane in planes])
        if (distances < 0).all(axis=0).any():
            return None
        for *normal, offset in planes if (distances < 0).any() else ():
            polygon = clip_polygon(polygon, polygon @ normal + offset)
            if len(polygon) < 3:
                return None
        return self.project(polygon)

    def box_of(self, points: Float[Array, "n 2"], margin: int = 1) -> Box:
        """x0, y0, x1, y1 of the pixels about the points, inside the picture."""
        low, high = np.floor(points.min(axis=0)) - margin, np.ceil(points.max(axis=0)) + margin
        x0, y0 = (int(v) for v in np.clip(low, 0, [self.width, self.height]))
        x1, y1 = (int(v) for v in np.clip(high, 0, [self.width, self.height]))
        return x0, y0, x1, y1


@dataclass(eq=False)
class Sample:
    """A picture in the making: one instant, one position inside the pixel."""

    image: UInt8[Array, "h w 3"]
    inverse_depth: Float[Array, "h w"]
    """Of blocks and people, 1/m; 0 elsewhere."""
    owner: UInt8[Array, "h w"]

    @classmethod
    def empty(cls, view: View) -> "Sample":
        """Black, nothing anywhere."""
        size = (view.height, view.width)
        return cls(np.zeros((*size, 3), np.uint8), np.zeros(size, np.float32), np.zeros(size, np.uint8))

    def copy(self) -> "Sample":
        """A sample that can be drawn on while this one is kept."""
        return Sample(self.image.copy(), self.inverse_depth.copy(), self.owner.copy())
