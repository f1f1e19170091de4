"""The floor around a person as seen from above: what pictures of the ground show of it, rectified.

All in the axes of a shot, levelled (z up), about the person's pelvis: a shadow then stays where it is while the person
walks, and the floor's own pattern does not.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from humanmm.models.body.body24 import PARENTS
from humanmm.models.camera.background.ground import HIDDEN
from humanmm.models.geometry.projection import project

Array = np.ndarray

CELL_M, REACH_M = 0.08, 1.9
"""Side of a cell of the floor, and how far from the pelvis it is looked at."""
SIDE = 2 * int(REACH_M / CELL_M)
"""Cells along each side."""
BESIDE_PX = 3
"""Smoothing and interpolation mix what lies so near."""
LIMB_M = 0.1
"""Radius about each bone within which a body may hide the floor."""
NEAREST_M = 0.3
LEAST_DEPRESSION = 0.02
LEAST_CELLS = 40
"""A picture that shows fewer cells says nothing."""
DARKEST = 4.0
"""Grey level below which the sensor tells nothing apart."""


@dataclass(frozen=True, eq=False)
class PosedOnFloor:
    """A person in F pictures of the ground of one shot."""

    joints: Float[Array, "F 24 3"]
    """About the pelvis, levelled axes, metres."""
    pelvis: Float[Array, "F 3"]
    """About the camera, levelled axes, metres."""
    floor: Float[Array, " F"]
    """Height of the floor about the camera, metres."""
    R_level_cam: Float[Array, "F 3 3"]
    K: Float[Array, "F 3 3"]
    """Of the pictures of the ground."""
    pictures: Sequence[UInt8[Array, "height width"]]
    """HIDDEN where somebody is (`GroundPicture.gray`)."""

    @property
    def height(self) -> Float[Array, "F 24"]:
        """Of the joints above the floor, metres, none below it."""
        return np.asarray(np.maximum(self.joints[..., 2] + (self.pelvis[:, 2] - self.floor)[:, None], 0.0))

    @property
    def depression(self) -> float:
        """Mean angle under which the floor below the person is seen, radians; at least LEAST_DEPRESSION."""
        away = np.linalg.norm(self.pelvis[:, :2], axis=1)
        return max(float(np.arctan2(-self.floor, away).mean()), LEAST_DEPRESSION)


@dataclass(frozen=True, eq=False)
class SeenFloor:
    """What F pictures show of the cells around a person."""

    log_brightness: Float[Array, "F side side"]
    """Against the picture's median; 0 where the cell is not seen. Rows along y, columns along x."""
    seen: Bool[Array, "F side side"]


def seen_floor(person: PosedOnFloor) -> SeenFloor:
    """The cells of the floor that pictures show, without what bodies hide."""
    along = (np.arange(SIDE) + 0.5) * CELL_M - REACH_M
    x, y = np.meshgrid(along, along)
    near = np.hypot(x, y) < REACH_M
    shape = (len(person.pictures), SIDE, SIDE)
    brightness, seen = np.zeros(shape), np.zeros(shape, bool)
    for k, picture in enumerate(person.pictures):
        cells = np.stack([x + person.pelvis[k, 0], y + person.pelvis[k, 1], np.full_like(x, person.floor[k])], axis=-1)
        at, depth = _in_picture(cells, person.R_level_cam[k], person.K[k])
        column, row = (at - 0.5).astype(np.float32).transpose(2, 0, 1)
        soft = cv2.GaussianBlur(picture, (3, 3), 0).astype(np.float32)
        values = np.log(np.maximum(cv2.remap(soft, column, row, cv2.INTER_LINEAR), DARKEST))
        shown = cv2.remap(_not_hidden(person, k), column, row, cv2.INTER_NEAREST, borderValue=0) > 0
        h, w = picture.shape
        inside = (column >= 1) & (row >= 1) & (column <= w - 2) & (row <= h - 2) & (depth > NEAREST_M)
        clear = near & inside & shown
        if clear.sum() >= LEAST_CELLS:
            seen[k] = clear
            brightness[k] = np.where(clear, values - np.median(values[clear]), 0.0)
    return SeenFloor(brightness, seen)


def _in_picture(
    points: Float[Array, "*n 3"], R_level_cam: Float[Array, "3 3"], K: Float[Array, "3 3"]
) -> tuple[Float[Array, "*n 2"], Float[Array, "*n"]]:
    """Pixels of points about the camera in levelled axes, and their depths."""
    in_camera = points @ R_level_cam
    return project(in_camera, K, near_m=1e-3), in_camera[..., 2]


def _not_hidden(person: PosedOnFloor, k: int) -> UInt8[Array, "height width"]:
    """255 where a picture may show floor: neither the person's own limbs nor, nearby, anybody's silhouette."""
    mask = cv2.erode(np.where(person.pictures[k] == HIDDEN, 0, 255).astype(np.uint8), np.ones((BESIDE_PX, BESIDE_PX)))
    at, depth = _in_picture(person.joints[k] + person.pelvis[k], person.R_level_cam[k], person.K[k])
    ends = np.clip(at, -9999, 9999).astype(int)
    for joint, parent in enumerate(PARENTS):
        nearest = min(depth[joint], depth[parent])
        if parent >= 0 and nearest > NEAREST_M:
            wide = max(2, int(2 * LIMB_M * person.K[k][0, 0] / nearest))
            cv2.line(mask, ends[parent].tolist(), ends[joint].tolist(), 0, wide)
    return mask
