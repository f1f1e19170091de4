"""The background scene without people: textured panels, warped by the homography of their plane.

Every pixel takes its colour from the level of the texture's pyramid that fits its footprint (trilinear). The shell is
drawn from far to near; blocks write their inverse depth, so that people stand before or behind them pixel by pixel.
"""

import math

import cv2
import numpy as np
from jaxtyping import Float

from humanmm.models.drawing.rasteriser import fill_polygons
from humanmm.models.rendering.background_scene import BackgroundScene, Panel
from humanmm.models.rendering.shadows import draw_block_shadow
from humanmm.models.rendering.view import BLOCK, FLOOR, SKY, Sample, View

Array = np.ndarray

_LOD_CELL = 8
"""Levels of detail are computed on a grid of so many pixels."""


def draw_background(view: View, scene: BackgroundScene) -> Sample:
    """The scene without people."""
    sample = Sample.empty(view)
    for panel in scene.shell:
        _draw_panel(sample, view, panel, solid=False)
    for block in scene.blocks:
        draw_block_shadow(sample, view, block, scene)
    eye = view.t_world_cam
    for block in sorted(scene.blocks, key=lambda b: -float(np.linalg.norm(b.centre - eye[:2]))):
        for panel in block.panels:
            if panel.faces(eye):
                _draw_panel(sample, view, panel, solid=True)
    for panel in scene.cutouts:
        if panel.faces(eye):
            _draw_panel(sample, view, panel, solid=True)
    return sample


def _draw_panel(sample: Sample, view: View, panel: Panel, *, solid: bool) -> None:
    outline = view.outline(panel.corners)
    if outline is None:
        return
    x0, y0, x1, y1 = view.box_of(outline)
    if x1 <= x0 or y1 <= y0:
        return
    mask = fill_polygons([outline - [x0 + 0.5, y0 + 0.5]], x1 - x0, y1 - y0, 1)
    # Pixel to texture: the inverse of the plane's homography.
    R_cam_world = view.R_world_cam.T
    axes = [R_cam_world @ panel.along, R_cam_world @ panel.across, view.to_camera(panel.corner)]
    plane = view.K @ np.stack(axes, axis=1)
    if abs(np.linalg.det(plane)) < 1e-9:
        return
    to_plane = np.linalg.inv(plane) @ _shift(x0 + 0.5, y0 + 0.5)
    size = (x1 - x0, y1 - y0)
    lod, inverse_depth = _level_of_detail(view, panel, size, (x0, y0))
    picture = _warp(panel.texture.levels, panel.texture.px_per_m, to_plane, lod, size)
    where = mask.view(bool)
    if picture.shape[2] == 4:  # a cut-out
        where = where & (picture[..., 3] > 127)
        picture = np.ascontiguousarray(picture[..., :3])
    if panel.light != 1.0:
        picture = cv2.convertScaleAbs(picture, alpha=panel.light)
    part = (slice(y0, y1), slice(x0, x1))
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
    distance = float(normal @ view.to_camera(panel.corner))
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


def _shift(x: float, y: float) -> Float[Array, "3 3"]:
    return np.array([[1, 0, x], [0, 1, y], [0, 0, 1.0]])
