"""Lit surfaces in camera axes to shaded regions of a picture, in a few milliseconds.

Shade is linear over a triangle (Gouraud 1971). Triangles of people who overlap in the picture are sorted together, so
that an arm in front of somebody else hides exactly what is behind it.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Int

from humanmm.models.drawing.rasteriser import clip_polygon, fill_triangles, front_facing, linear_coefficients

NEAR_M = 0.05
_LARGEST_COORDINATE_PX = 30_000.0
_MOST_PIXELS = 400_000
"""Regions larger than this are rasterised at half resolution."""
_STEEPEST_SHADE = 0.12
"""Largest change of shade a pixel, against slivers whose gradient is meaningless."""

_KEY_LIGHT = np.array([-0.45, -0.65, -0.62], np.float32)
"""Direction from the surface to the light, camera axes (x right, y down): above left, behind the camera."""
_FILL_LIGHT = np.array([0.75, 0.1, -0.65], np.float32)


@dataclass(frozen=True)
class Triangles:
    """The visible triangles of one surface, projected. T triangles."""

    corners_px: Float[np.ndarray, "T 3 2"]
    """Pixel centres at .5."""
    depth: Float[np.ndarray, " T"]
    """Mean distance along the camera's axis, metres."""
    shade: Float[np.ndarray, "T 3"]
    """Light at each corner, 0..1."""

    @property
    def box(self) -> tuple[float, float, float, float]:
        """x0, y0, x1, y1 in pixels."""
        low, high = self.corners_px.min((0, 1)), self.corners_px.max((0, 1))
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])


@dataclass(frozen=True)
class Region:
    """A rectangle of the picture with what covers it."""

    x: int
    y: int
    surface: Int[np.ndarray, "h w"]
    """Index of the surface in front, −1 for none."""
    shade: Float[np.ndarray, "h w"]
    """Light, 0..255 as uint8."""
    coverage: Float[np.ndarray, "h w"]
    """0..255 as uint8, soft at the edge."""


def project(
    vertices: Float[np.ndarray, "V 3"],
    normals: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    K: Float[np.ndarray, "3 3"],
    up_cam: Float[np.ndarray, "3"],
) -> Triangles:
    """Light, clip at the near plane, project, and keep the triangles that face the camera."""
    light = _light(normals, up_cam)
    is_before_plane = vertices[:, 2] > NEAR_M
    if not is_before_plane.all():
        vertices, light, faces = _clip(vertices, light, faces, is_before_plane)
    focal = np.array([K[0, 0], K[1, 1]], np.float32)
    center = np.array([K[0, 2], K[1, 2]], np.float32)
    pixels = vertices[:, :2] / vertices[:, 2:] * focal + center
    np.clip(pixels, -_LARGEST_COORDINATE_PX, _LARGEST_COORDINATE_PX, out=pixels)
    visible = faces.compress(front_facing(pixels[:, 0].take(faces.T), pixels[:, 1].take(faces.T)), axis=0)
    return Triangles(pixels.take(visible, axis=0), vertices[:, 2].take(visible).mean(1), light.take(visible))


def rasterise(surfaces: list[Triangles], width: int, height: int) -> list[Region]:
    """The parts of a width × height picture that surfaces cover; surfaces whose boxes overlap share one region.

    Positions and sides of regions are even if the picture's sides are.
    """
    regions = []
    for members, box in _overlapping(surfaces, width, height):
        x0, y0, x1, y1 = box
        scale = 1.0 if (x1 - x0) * (y1 - y0) <= _MOST_PIXELS else 0.5
        regions.append(_fill([(i, surfaces[i]) for i in members], box, scale))
    return regions


def _light(normals: np.ndarray, up_cam: np.ndarray) -> np.ndarray:
    key = np.maximum(normals @ (_KEY_LIGHT / np.linalg.norm(_KEY_LIGHT)), 0)
    fill = np.maximum(normals @ (_FILL_LIGHT / np.linalg.norm(_FILL_LIGHT)), 0)
    sky = 0.5 + 0.5 * (normals @ up_cam.astype(np.float32))
    return np.asarray(np.clip(0.02 + 0.62 * key + 0.18 * fill + 0.2 * sky, 0, 1), np.float32)


def _clip(
    vertices: np.ndarray, light: np.ndarray, faces: np.ndarray, is_before_plane: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cut triangles at the near plane: corners behind it are replaced by where their edges cross it."""
    count = is_before_plane[faces].sum(1)
    corners, kept = [np.concatenate([vertices, light[:, None]], axis=1)], [faces[count == 3]]
    first = len(vertices)
    for face in faces[(count == 1) | (count == 2)]:
        polygon = clip_polygon(corners[0][face], vertices[face, 2] - np.float32(NEAR_M))
        corners.append(polygon)
        kept.append(first + np.array([(0, i, i + 1) for i in range(1, len(polygon) - 1)]))
        first += len(polygon)
    together = np.concatenate(corners)
    return together[:, :3], together[:, 3], np.concatenate(kept)


Box = tuple[int, int, int, int]


def _overlapping(surfaces: list[Triangles], width: int, height: int) -> list[tuple[list[int], Box]]:
    """Groups of surfaces whose boxes overlap, each with its box inside the picture."""
    groups: list[tuple[list[int], Box]] = []
    for index, surface in enumerate(surfaces):
        if len(surface.depth) == 0:
            continue
        x0, y0, x1, y1 = surface.box
        low_x, low_y, high_x, high_y = int(x0) - 2, int(y0) - 2, int(x1) + 4, int(y1) + 4
        box = (
            max(low_x - low_x % 2, 0), max(low_y - low_y % 2, 0),
            min(high_x - high_x % 2, width), min(high_y - high_y % 2, height),
        )  # fmt: skip
        if box[0] >= box[2] or box[1] >= box[3]:
            continue
        members = [index]
        apart = []
        for other_members, other in groups:
            if box[0] < other[2] and other[0] < box[2] and box[1] < other[3] and other[1] < box[3]:
                members += other_members
                box = (min(box[0], other[0]), min(box[1], other[1]), max(box[2], other[2]), max(box[3], other[3]))
            else:
                apart.append((other_members, other))
        groups = [*apart, (members, box)]
    return groups


def _fill(members: list[tuple[int, Triangles]], box: Box, scale: float) -> Region:
    x0, y0, x1, y1 = box
    width, height = max(1, round((x1 - x0) * scale)), max(1, round((y1 - y0) * scale))
    order = np.argsort(-np.concatenate([t.depth for _, t in members]), kind="stable")
    corners = np.concatenate([t.corners_px for _, t in members])[order]
    # OpenCV's pixel centres lie at integers
    corners = (corners - np.array([x0, y0], np.float32)) * np.float32(scale) - np.float32(0.5)
    shade = np.concatenate([t.shade for _, t in members])[order]

    number = fill_triangles(corners, width, height)
    coefficients = linear_coefficients(corners, shade[..., None], steepest=_STEEPEST_SHADE)
    planes = [np.append(np.float32(0), one.astype(np.float32)) for one in coefficients]  # number 0: the background
    lit = planes[0].take(number)
    lit *= np.arange(width, dtype=np.float32)
    lit += planes[1].take(number) * np.arange(height, dtype=np.float32)[:, None]
    lit += planes[2].take(number)
    np.clip(lit, 0, 1, out=lit)
    light = (lit * 255).astype(np.uint8)

    covered = number > 0
    mask = covered.view(np.uint8) * np.uint8(255)
    coverage = cv2.min(cv2.blur(mask, (3, 3)), mask)
    owner = np.concatenate([[-1], np.repeat([i for i, _ in members], [len(t.depth) for _, t in members])[order]])
    surface = owner.astype(np.int16).take(number)
    if scale != 1.0:
        size = (x1 - x0, y1 - y0)
        return Region(
            x0,
            y0,
            np.asarray(cv2.resize(surface, size, interpolation=cv2.INTER_NEAREST)),
            np.asarray(cv2.resize(light, size, interpolation=cv2.INTER_LINEAR)),
            np.asarray(cv2.resize(coverage, size, interpolation=cv2.INTER_LINEAR)),
        )
    return Region(x0, y0, surface, light, coverage)
