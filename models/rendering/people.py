"""Clothed people in a picture: triangles textured from a UV atlas and lit by the lamp (Gouraud 1971)."""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8

from humanmm.models.drawing.rasteriser import fill_triangles, front_facing, linear_coefficients
from humanmm.models.rendering.background_scene import Light
from humanmm.models.rendering.view import NEAR_M, Sample, View

Array = np.ndarray

_LOOK_UP_PX = 1024
"""OpenCV looks up colours in rectangles whose sides are below 32,768; ours are so wide."""


@dataclass(frozen=True, eq=False)
class PosedPerson:
    """One person's mesh at one instant, world axes."""

    vertices: Float[Array, "V 3"]
    normals: Float[Array, "V 3"]
    faces: Int[Array, "F 3"]
    atlas_px: Float[Array, "F 3 2"]
    """Position of every triangle's corners in the atlas, the first pixel's centre at .5."""
    atlas: UInt8[Array, "h w 3"]


def draw_person(sample: Sample, view: View, person: PosedPerson, light: Light, number: int) -> None:
    """Draw one person where nothing nearer has been drawn; their pixels get this number as owner."""
    in_camera = view.to_camera(person.vertices).astype(np.float32)
    faces = person.faces
    pixels = view.project(np.where(in_camera[:, 2:] > NEAR_M, in_camera, [0, 0, 1.0])).astype(np.float32)
    x, y = (pixels[:, k].take(faces.T) for k in (0, 1))
    nearest = np.minimum.reduce(in_camera[:, 2].take(faces.T))
    inside = (np.maximum.reduce(x) > 0) & (np.minimum.reduce(x) < view.width)
    inside &= (np.maximum.reduce(y) > 0) & (np.minimum.reduce(y) < view.height)
    chosen = np.flatnonzero((nearest > NEAR_M) & inside & front_facing(x, y))
    if not len(chosen):
        return
    depth = in_camera[:, 2].take(faces[chosen].T).mean(axis=0)
    order = np.argsort(-depth, kind="stable")
    chosen, depth = chosen[order], depth[order]
    corners = np.stack([x[:, chosen].T, y[:, chosen].T], axis=-1)
    x0, y0, x1, y1 = view.box_of(corners.reshape(-1, 2))
    corners = corners - np.array([x0, y0], np.float32) - np.float32(0.5)
    index = fill_triangles(corners, x1 - x0, y1 - y0)

    inverse_depth = np.concatenate([[0], 1 / depth]).astype(np.float32).take(index)
    part = (slice(y0, y1), slice(x0, x1))
    ours = (index > 0) & (inverse_depth > sample.inverse_depth[part])
    rows, columns = np.nonzero(ours)
    if not len(rows):
        return
    brightness = light.on(person.normals / (np.linalg.norm(person.normals, axis=1, keepdims=True) + 1e-9))
    values = np.concatenate([person.atlas_px[chosen], brightness[faces[chosen]][..., None]], axis=-1)
    u, v, lit = _interpolated(corners, values.astype(np.float32), index[rows, columns] - 1, columns, rows)
    colours = _look_up(person.atlas, u, v)
    sample.image[part][ours] = np.clip(colours * lit[:, None], 0, 255).astype(np.uint8)
    sample.inverse_depth[part][ours] = inverse_depth[ours]
    sample.owner[part][ours] = number


def _interpolated(
    corners: Float[Array, "T 3 2"], values: Float[Array, "T 3 C"], triangle: Array, x: Array, y: Array
) -> tuple[Array, ...]:
    """Each of the C values at pixels of known triangles, kept inside the range of the triangle's corners."""
    a, b, c = linear_coefficients(corners, values)
    x, y = x.astype(np.float32), y.astype(np.float32)
    low, high = np.minimum.reduce(values, axis=1), np.maximum.reduce(values, axis=1)
    found = []
    for k in range(values.shape[-1]):
        raw = a[triangle, k] * x + b[triangle, k] * y + c[triangle, k]
        found.append(np.clip(raw, low[triangle, k], high[triangle, k]))
    return tuple(found)


def _look_up(image: UInt8[Array, "h w 3"], u: Float[Array, " n"], v: Float[Array, " n"]) -> UInt8[Array, "n 3"]:
    """Colours of an image at positions (pixel centres at .5), bilinear."""
    rows = -(-len(u) // _LOOK_UP_PX)
    positions = np.zeros((2, rows * _LOOK_UP_PX), np.float32)
    positions[0, : len(u)], positions[1, : len(v)] = u - 0.5, v - 0.5
    grid = positions.reshape(2, rows, _LOOK_UP_PX)
    found = cv2.remap(image, grid[0], grid[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(found.reshape(-1, 3)[: len(u)])
