"""Shadows that blocks and people cast on the floor, z = 0, from the one lamp."""

import cv2
import numpy as np
from jaxtyping import Float, Int

from humanmm.models.drawing.rasteriser import fill_polygons
from humanmm.models.rendering.background_scene import BackgroundScene, Block
from humanmm.models.rendering.view import FLOOR, NEAR_M, Sample, View

Array = np.ndarray

_FARTHEST_PX = 20_000.0
_BLUR_PX = 5


def draw_block_shadow(sample: Sample, view: View, block: Block, scene: BackgroundScene) -> None:
    """The shadow of a block: the convex hull of its foot and of its top, projected onto the floor."""
    top = block.top_corners
    points = np.concatenate([top, _on_floor(top, scene)])[:, :2].astype(np.float32)
    hull = cv2.convexHull(points)[:, 0]
    outline = view.outline(np.concatenate([hull, np.zeros((len(hull), 1))], axis=1))
    if outline is not None:
        _darken(sample, view, outline[None], scene.light.shadow)


def draw_person_shadow(
    sample: Sample, view: View, vertices: Float[Array, "V 3"], faces: Int[Array, "F 3"], scene: BackgroundScene
) -> None:
    """The shadow of a person's mesh, which may be coarser than the one that is drawn."""
    corners = vertices[faces]
    toward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ scene.light.direction > 0
    in_camera = view.to_camera(_on_floor(corners[toward], scene))
    in_camera = in_camera[(in_camera[..., 2] > 4 * NEAR_M).all(axis=1)]
    if len(in_camera):
        _darken(sample, view, view.project(in_camera), scene.light.shadow)


def _on_floor(points: Float[Array, "*n 3"], scene: BackgroundScene) -> Float[Array, "*n 3"]:
    """Points projected onto the floor along the lamp's direction."""
    direction = scene.light.direction
    return np.asarray(points - points[..., 2:] / direction[2] * direction)


def _darken(sample: Sample, view: View, polygons: Float[Array, "p n 2"], strength: float) -> None:
    """Take a fraction `strength` of the light from the floor under polygons in the picture, with soft edges."""
    x0, y0, x1, y1 = view.box_of(polygons.reshape(-1, 2), margin=4)
    if x1 <= x0 or y1 <= y0:
        return
    corners = np.clip(polygons - [x0 + 0.5, y0 + 0.5], -_FARTHEST_PX, _FARTHEST_PX)
    soft = cv2.blur(fill_polygons(corners, x1 - x0, y1 - y0, 255), (_BLUR_PX, _BLUR_PX))
    part = (slice(y0, y1), slice(x0, x1))
    soft[sample.owner[part] != FLOOR] = 0
    kept = (255 - soft * np.float32(strength)) / 255
    sample.image[part] = (sample.image[part] * kept[..., None]).astype(np.uint8)
