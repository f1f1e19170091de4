"""The software rasteriser of overlays and rendered clips: numbers of triangles in a picture, values linear over them.

Painter's algorithm: OpenCV fills triangles with their own number from far to near, a microsecond each; every pixel then
looks up what belongs to its triangle. Corners are in OpenCV's pixels: the first pixel's centre is at 0.
"""

from collections.abc import Iterable

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

_SHIFT = 4
"""Fractional bits of the corners."""


def front_facing(x: Float[np.ndarray, "3 T"], y: Float[np.ndarray, "3 T"]) -> Bool[np.ndarray, " T"]:
    """Whether triangles that are counter-clockwise from outside face the camera; pixels, y down."""
    return np.asarray((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]) < 0)


def fill_triangles(corners: Float[np.ndarray, "T 3 2"], width: int, height: int) -> Int[np.ndarray, "height width"]:
    """Number 1 … T of the triangle in front of every pixel, 0 for none. Triangles come from far to near."""
    number = np.zeros((height, width), np.int32)
    fill = cv2.fillConvexPoly
    for index, fixed in enumerate(_fixed_point(corners), start=1):
        fill(number, fixed, index, cv2.LINE_8, _SHIFT)
    return number


def fill_polygons(
    polygons: Iterable[Float[np.ndarray, "n 2"]], width: int, height: int, value: int
) -> UInt8[np.ndarray, "height width"]:
    """`value` inside convex polygons, 0 elsewhere."""
    mask = np.zeros((height, width), np.uint8)
    for fixed in _fixed_point(polygons) if isinstance(polygons, np.ndarray) else map(_fixed_point, polygons):
        cv2.fillConvexPoly(mask, fixed, value, cv2.LINE_8, _SHIFT)
    return mask


def linear_coefficients(
    corners: Float[np.ndarray, "T 3 2"], values: Float[np.ndarray, "T 3 C"], *, steepest: float = np.inf
) -> tuple[Float[np.ndarray, "T C"], Float[np.ndarray, "T C"], Float[np.ndarray, "T C"]]:
    """a, b, c of value = a x + b y + c for every triangle and channel, from the values at its corners.

    |a|, |b| ≤ `steepest`: the gradient of a sliver is meaningless.
    """
    x, y = corners[..., 0], corners[..., 1]
    dx1, dy1, dx2, dy2 = x[:, 1] - x[:, 0], y[:, 1] - y[:, 0], x[:, 2] - x[:, 0], y[:, 2] - y[:, 0]
    area = dx1 * dy2 - dx2 * dy1
    area = np.where(np.abs(area) < 1e-3, np.inf, area)[:, None]
    d1, d2 = values[:, 1] - values[:, 0], values[:, 2] - values[:, 0]
    a = np.clip((d1 * dy2[:, None] - d2 * dy1[:, None]) / area, -steepest, steepest)
    b = np.clip((d2 * dx1[:, None] - d1 * dx2[:, None]) / area, -steepest, steepest)
    return a, b, values.mean(axis=1) - a * x.mean(1)[:, None] - b * y.mean(1)[:, None]


def clip_polygon(points: Float[np.ndarray, "n D"], distance: Float[np.ndarray, " n"]) -> Float[np.ndarray, "m D"]:
    """The part of a convex polygon on the side of a plane where `distance` ≥ 0 (Sutherland and Hodgman 1974).

    `distance`: of every corner from the plane, at any scale. New corners are linear between the old ones in all D
    coordinates.
    """
    kept = []
    for k in range(len(points)):
        following = (k + 1) % len(points)
        if distance[k] >= 0:
            kept.append(points[k])
        if (distance[k] >= 0) != (distance[following] >= 0):
            fraction = distance[k] / (distance[k] - distance[following])
            kept.append(points[k] + fraction * (points[following] - points[k]))
    return np.stack(kept) if kept else points[:0]


def _fixed_point(corners: Float[np.ndarray, "*n 2"]) -> Int[np.ndarray, "*n 2"]:
    return np.asarray(np.rint(corners * (1 << _SHIFT)), np.int32)
