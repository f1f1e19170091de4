"""The rasteriser: one sample of a picture (one instant, one place inside the pixel) of panels and people.

Panels are warped by the homography of their plane, each pixel from the level of the texture's pyramid that fits its
footprint (trilinear). The shell is painted from far to near; blocks write their inverse depth, so that people stand
before or behind them pixel by pixel. A person's triangles are filled with their own number from far to near by OpenCV
(a microsecond each), then every pixel looks up where on the doll it is and how much light it gets, both linear over
the triangle. Coordinates: continuous pixels, the first pixel's centre at .5.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from humanmm.models.rendering.background_scene import Block, Panel, Scenery

Array = np.ndarray

NEAR_M = 0.08
_SHIFT = 4
_LOD_CELL = 8
"""Levels of detail are computed on a grid of so many pixels."""
SKY, FLOOR, BLOCK, FIRST_PERSON = 0, 1, 2, 3
"""What a pixel shows; people count from FIRST_PERSON."""


@dataclass(frozen=True, eq=False)
class View:
    """A camera at one instant."""

    R_world_cam: Float[Array, "3 3"]
    t_world_cam: Float[Array, "3"]
    K: Float[Array, "3 3"]
    width: int
    height: int

    def see(self, points: Float[Array, "*n 3"]) -> Float[Array, "*n 3"]:
        """World points in camera axes."""
        return np.asarray((points - self.t_world_cam) @ self.R_world_cam)

    def project(self, in_camera: Float[Array, "*n 3"]) -> Float[Array, "*n 2"]:
        """Pixels of points in front of the camera."""
        projected = in_camera @ self.K.T
        return np.asarray(projected[..., :2] / projected[..., 2:])


@dataclass(eq=False)
class Sample:
    """A picture in the making."""

    image: UInt8[Array, "h w 3"]
    inverse_depth: Float[Array, "h w"]
    """Of blocks and people, 1/m; 0 elsewhere."""
    owner: UInt8[Array, "h w"]

    def copy(self) -> "Sample":
        return Sample(self.image.copy(), self.inverse_depth.copy(), self.owner.copy())


@dataclass(frozen=True, eq=False)
class PosedSkin:
    """One person's skin at one instant."""

    vertices: Float[Array, "V 3"]
    normals: Float[Array, "V 3"]
    faces: Array
    doll_px: Float[Array, "F 3 2"]
    """Where the corners of every triangle lie on the doll."""
    doll: UInt8[Array, "h 2w 3"]


def paint_set(view: View, scenery: Scenery) -> Sample:
    """The set without people."""
    sample = Sample(
        np.zeros((view.height, view.width, 3), np.uint8),
        np.zeros((view.height, view.width), np.float32),
        np.zeros((view.height, view.width), np.uint8),
    )
    for panel in scenery.shell:
        _paint_panel(sample, view, panel, solid=False)
    for block in scenery.blocks:
        _cast(sample, view, _shadow_of_block(block, scenery), scenery.light.shadow)
    eye = view.t_world_cam
    for block in sorted(scenery.blocks, key=lambda b: -float(np.linalg.norm(b.centre - eye[:2]))):
        for panel in block.panels:
            if np.cross(panel.along, panel.across) @ (eye - panel.corner) < 0:  # a face looks at us
                _paint_panel(sample, view, panel, solid=True)
    return sample


def paint_shadow(sample: Sample, view: View, skin: PosedSkin, faces: Array, scenery: Scenery) -> None:
    """The shadow that a person casts on the floor; `faces` may be a coarser mesh over the same vertices."""
    corners = skin.vertices[faces]
    toward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ scenery.light.direction > 0
    _cast(sample, view, _on_floor(corners[toward], scenery), scenery.light.shadow)


def paint_person(sample: Sample, view: View, skin: PosedSkin, scenery: Scenery, number: int) -> None:
    """One dressed person, hidden by whatever is nearer."""
    in_camera = view.see(skin.vertices).astype(np.float32)
    faces = skin.faces
    pixels = view.project(np.where(in_camera[:, 2:] > NEAR_M, in_camera, [0, 0, 1.0])).astype(np.float32)
    x, y = (pixels[:, k].take(faces.T) for k in (0, 1))
    area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
    nearest = np.minimum.reduce(in_camera[:, 2].take(faces.T))
    inside = (np.maximum.reduce(x) > 0) & (np.minimum.reduce(x) < view.width)
    inside &= (np.maximum.reduce(y) > 0) & (np.minimum.reduce(y) < view.height)
    chosen = np.flatnonzero((nearest > NEAR_M) & inside & (area < 0))  # counter-clockwise from outside, y down
    if not len(chosen):
        return
    depth = in_camera[:, 2].take(faces[chosen].T).mean(axis=0)
    order = np.argsort(-depth, kind="stable")
    chosen, depth = chosen[order], depth[order]
    corners = np.stack([x[:, chosen].T, y[:, chosen].T], axis=-1)
    x0, y0, x1, y1 = _clipped_box(corners.reshape(-1, 2), view)
    corners = corners - np.array([x0, y0], np.float32) - np.float32(0.5)  # OpenCV's centres lie at integers
    index = np.zeros((y1 - y0, x1 - x0), np.int32)
    fill = cv2.fillConvexPoly
    for number_of, fixed in enumerate(np.rint(corners * (1 << _SHIFT)).astype(np.int32), start=1):
        fill(index, fixed, number_of, cv2.LINE_8, _SHIFT)

    light = scenery.light.on(skin.normals / (np.linalg.norm(skin.normals, axis=1, keepdims=True) + 1e-9))
    inverse_depth = np.concatenate([[0], 1 / depth]).astype(np.float32).take(index)
    part = (slice(y0, y1), slice(x0, x1))
    ours = (index > 0) & (inverse_depth > sample.inverse_depth[part])
    rows, columns = np.nonzero(ours)
    if not len(rows):
        return
    triangle = index[rows, columns] - 1
    values = np.concatenate([skin.doll_px[chosen], light[faces[chosen]][..., None]], axis=-1).astype(np.float32)
    u, v, lit = _linear(corners, values, triangle, columns, rows)
    colours = _look_up(skin.doll, u, v)
    sample.image[part][ours] = np.clip(colours * lit[:, None], 0, 255).astype(np.uint8)
    sample.inverse_depth[part][ours] = inverse_depth[ours]
    sample.owner[part][ours] = number


def _linear(corners: Array, values: Array, triangle: Array, x: Array, y: Array) -> tuple[Array, ...]:
    """Values, linear over each triangle, at pixels; kept inside the range of the triangle's corners."""
    dx1, dy1 = corners[:, 1, 0] - corners[:, 0, 0], corners[:, 1, 1] - corners[:, 0, 1]
    dx2, dy2 = corners[:, 2, 0] - corners[:, 0, 0], corners[:, 2, 1] - corners[:, 0, 1]
    area = dx1 * dy2 - dx2 * dy1
    area = np.where(np.abs(area) < 1e-3, np.inf, area)[:, None]
    d1, d2 = values[:, 1] - values[:, 0], values[:, 2] - values[:, 0]
    a = (d1 * dy2[:, None] - d2 * dy1[:, None]) / area
    b = (d2 * dx1[:, None] - d1 * dx2[:, None]) / area
    c = values.mean(axis=1) - a * corners[..., 0].mean(1)[:, None] - b * corners[..., 1].mean(1)[:, None]
    x, y = x.astype(np.float32), y.astype(np.float32)
    low, high = np.minimum.reduce(values, axis=1), np.maximum.reduce(values, axis=1)
    found = []
    for k in range(values.shape[-1]):
        raw = a[triangle, k] * x + b[triangle, k] * y + c[triangle, k]
        found.append(np.clip(raw, low[triangle, k], high[triangle, k]))
    return tuple(found)


def _look_up(image: UInt8[Array, "h w 3"], u: Float[Array, " n"], v: Float[Array, " n"]) -> UInt8[Array, "n 3"]:
    """Colours of an image at places (pixel centres at .5); OpenCV wants them as a rectangle with short sides."""
    rows = -(-len(u) // 1024)
    places = np.zeros((2, rows * 1024), np.float32)
    places[0, : len(u)], places[1, : len(v)] = u - 0.5, v - 0.5
    grid = places.reshape(2, rows, 1024)
    found = cv2.remap(image, grid[0], grid[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(found.reshape(-1, 3)[: len(u)])


def _paint_panel(sample: Sample, view: View, panel: Panel, *, solid: bool) -> None:
    outline = _outline(view, panel.corners)
    if outline is None:
        return
    x0, y0, x1, y1 = _clipped_box(outline, view)
    if x1 <= x0 or y1 <= y0:
        return
    mask = _filled(outline, (x0, y0, x1, y1))
    # Pixel to texture: the inverse of the plane's homography.
    turn = view.R_world_cam.T
    plane = view.K @ np.stack([turn @ panel.along, turn @ panel.across, view.see(panel.corner)], axis=1)
    if abs(np.linalg.det(plane)) < 1e-9:
        return
    to_plane = np.linalg.inv(plane) @ _shift(x0 + 0.5, y0 + 0.5)
    size = (x1 - x0, y1 - y0)
    lod, inverse_depth = _level_of_detail(view, panel, size, (x0, y0))
    picture = _warp(panel.texture.levels, panel.texture.px_per_m, to_plane, lod, size)
    if panel.light != 1.0:
        picture = cv2.convertScaleAbs(picture, alpha=panel.light)
    part = (slice(y0, y1), slice(x0, x1))
    where = mask.view(bool)
    if solid:
        full = cv2.resize(inverse_depth, size, interpolation=cv2.INTER_LINEAR)
        where = where & (full > sample.inverse_depth[part])
        np.copyto(sample.inverse_depth[part], full, where=where)
    sample.image[part] = cv2.copyTo(picture, where.view(np.uint8), np.ascontiguousarray(sample.image[part]))
    np.copyto(sample.owner[part], BLOCK if solid else FLOOR if panel.is_floor else SKY, where=where)


def _warp(levels: tuple[Array, ...], px_per_m: float, to_plane: Array, lod: Array, size: tuple[int, int]) -> Array:
    """The texture as the camera sees it: the two levels that fit each pixel, blended."""
    top = len(levels) - 1
    first = int(np.clip(np.floor(lod.min()), 0, top))
    last = int(np.clip(np.ceil(lod.max()), first, top))

    def level(number: int, band: slice) -> Array:
        scale = px_per_m * levels[number].shape[1] / levels[0].shape[1]
        scale_y = px_per_m * levels[number].shape[0] / levels[0].shape[0]
        matrix = _shift(-0.5, -0.5) @ np.diag([scale, scale_y, 1.0]) @ to_plane @ _shift(0, band.start)
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return np.asarray(
            cv2.warpPerspective(
                levels[number], matrix, (size[0], band.stop - band.start), flags=flags, borderMode=cv2.BORDER_WRAP
            )
        )

    picture = level(first, slice(0, size[1]))
    for number in range(first + 1, last + 1):
        weight = np.clip(lod - (number - 1), 0.0, 1.0)
        rows = np.flatnonzero(weight.max(axis=1) > 0.02)
        if not len(rows):
            break
        scale = size[1] / len(lod)
        band = slice(int(max(rows[0] - 1, 0) * scale), min(math.ceil((rows[-1] + 2) * scale), size[1]))
        fine = np.clip(cv2.resize(weight, size, interpolation=cv2.INTER_LINEAR)[band], 0, 1)
        picture[band] = cv2.blendLinear(level(number, band), picture[band], fine, 1 - fine)
    return picture


def _level_of_detail(
    view: View, panel: Panel, size: tuple[int, int], corner: tuple[int, int]
) -> tuple[Float[Array, "rows columns"], Float[Array, "rows columns"]]:
    """log₂ of texels a pixel (geometric mean over the footprint's axes), and inverse depth, on a coarse grid."""
    normal = view.R_world_cam.T @ np.cross(panel.along, panel.across)
    distance = float(normal @ view.see(panel.corner))
    columns, rows = (max(2, -(-side // _LOD_CELL)) for side in size)
    x = corner[0] + (np.arange(columns) + 0.5) * size[0] / columns
    y = corner[1] + (np.arange(rows) + 0.5) * size[1] / rows
    ray_x, ray_y = (x - view.K[0, 2]) / view.K[0, 0], (y - view.K[1, 2]) / view.K[1, 1]
    inverse_depth = (normal[0] * ray_x[None] + normal[1] * ray_y[:, None] + normal[2]) / distance
    length = np.sqrt(1 + ray_x[None] ** 2 + ray_y[:, None] ** 2)
    clipped = np.maximum(inverse_depth, 1e-3)
    facing = np.clip(clipped * abs(distance) / length, 0.02, 1.0)
    texels = panel.texture.px_per_m / (clipped * view.K[0, 0]) / np.sqrt(facing)
    return np.log2(texels).astype(np.float32), inverse_depth.astype(np.float32)


def _outline(view: View, corners: Float[Array, "n 3"]) -> Float[Array, "m 2"] | None:
    """The visible part of a convex polygon in pixels: cut at the near plane and a little outside the picture."""
    polygon = view.see(corners)
    f, (cx, cy) = np.array([view.K[0, 0], view.K[1, 1]]), view.K[:2, 2]
    margin = 8.0
    planes = np.array(
        [
            [0, 0, 1, -NEAR_M],
            [f[0], 0, cx + margin, 0],
            [-f[0], 0, view.width + margin - cx, 0],
            [0, f[1], cy + margin, 0],
            [0, -f[1], view.height + margin - cy, 0],
        ]
    )
    for plane in planes:  # Sutherland and Hodgman 1974
        side = polygon @ plane[:3] + plane[3]
        kept: list[Array] = []
        for k in range(len(polygon)):
            following = (k + 1) % len(polygon)
            if side[k] >= 0:
                kept.append(polygon[k])
            if (side[k] >= 0) != (side[following] >= 0):
                share = side[k] / (side[k] - side[following])
                kept.append(polygon[k] + share * (polygon[following] - polygon[k]))
        if len(kept) < 3:
            return None
        polygon = np.stack(kept)
    return view.project(polygon)


def _shadow_of_block(block: Block, scenery: Scenery) -> Float[Array, "n 3"]:
    """The outline of a block's shadow on the floor."""
    top = block.top_corners
    thrown = _on_floor(top, scenery)
    points = np.concatenate([top * [1, 1, 0], thrown])[:, :2].astype(np.float32)
    hull = cv2.convexHull(points)[:, 0]
    return np.concatenate([hull, np.zeros((len(hull), 1))], axis=1)[None]


def _on_floor(points: Float[Array, "*n 3"], scenery: Scenery) -> Float[Array, "*n 3"]:
    """Where the lamp throws points on the floor."""
    direction = scenery.light.direction
    return np.asarray(points - points[..., 2:] / direction[2] * direction)


def _cast(sample: Sample, view: View, polygons: Float[Array, "p n 3"], strength: float) -> None:
    """Darken the floor under polygons that lie on it."""
    in_camera = view.see(polygons)
    if len(polygons) == 1:
        outline = _outline(view, polygons[0])
        pixels = None if outline is None else outline[None]
    else:
        in_camera = in_camera[(in_camera[..., 2] > 4 * NEAR_M).all(axis=1)]
        pixels = view.project(in_camera) if len(in_camera) else None
    if pixels is None:
        return
    x0, y0, x1, y1 = _clipped_box(pixels.reshape(-1, 2), view, margin=4)
    if x1 <= x0 or y1 <= y0:
        return
    mask = np.zeros((y1 - y0, x1 - x0), np.uint8)
    limited = np.clip(pixels - [x0 + 0.5, y0 + 0.5], -20_000, 20_000)
    for fixed in np.rint(limited * (1 << _SHIFT)).astype(np.int32):
        cv2.fillConvexPoly(mask, fixed, 255, cv2.LINE_8, _SHIFT)
    soft = cv2.blur(mask, (5, 5))
    part = (slice(y0, y1), slice(x0, x1))
    soft[sample.owner[part] != FLOOR] = 0
    kept = (255 - soft * np.float32(strength)) / 255
    sample.image[part] = (sample.image[part] * kept[..., None]).astype(np.uint8)


def _filled(outline: Float[Array, "n 2"], box: tuple[int, int, int, int]) -> UInt8[Array, "h w"]:
    x0, y0, x1, y1 = box
    mask = np.zeros((y1 - y0, x1 - x0), np.uint8)
    fixed = np.rint((outline - [x0 + 0.5, y0 + 0.5]) * (1 << _SHIFT)).astype(np.int32)
    cv2.fillConvexPoly(mask, fixed, 1, cv2.LINE_8, _SHIFT)
    return mask


def _clipped_box(points: Float[Array, "n 2"], view: View, margin: int = 1) -> tuple[int, int, int, int]:
    low, high = np.floor(points.min(axis=0)) - margin, np.ceil(points.max(axis=0)) + margin
    x0, y0 = (int(v) for v in np.clip(low, 0, [view.width, view.height]))
    x1, y1 = (int(v) for v in np.clip(high, 0, [view.width, view.height]))
    return x0, y0, x1, y1


def _shift(x: float, y: float) -> Float[Array, "3 3"]:
    return np.array([[1, 0, x], [0, 1, y], [0, 0, 1.0]])
