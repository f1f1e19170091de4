"""Boxes in pictures: xyxy, the corners with the least and the greatest x and y, in pixels."""

import numpy as np
from jaxtyping import Float

Array = np.ndarray

_GRID = 8
"""Points along a side of a box."""


def box_iou(a: Float[Array, "*#n 4"], b: Float[Array, "*#n 4"]) -> Float[Array, "*n"]:
    """Intersection over union of boxes xyxy, 0 to 1; 0 where neither holds anything.

    Shapes broadcast: `box_iou(a[:, None], b[None])` compares every pair. Jaccard 1901; Everingham et al., "The Pascal
    Visual Object Classes challenge" (IJCV 88, 2010), section 4.2.
    """
    shared = box_area(np.concatenate([np.maximum(a[..., :2], b[..., :2]), np.minimum(a[..., 2:], b[..., 2:])], axis=-1))
    union = box_area(a) + box_area(b) - shared
    return np.asarray(shared / np.maximum(union, np.finfo(float).tiny))


def covered(boxes: Float[Array, "n 4"], others: Float[Array, "m 4"]) -> Float[Array, " n"]:
    """The part 0 to 1 of each box that lies in any of the others, from a grid of points in it."""
    across = (np.arange(_GRID) + 0.5) / _GRID
    at = np.stack(np.meshgrid(across, across), axis=-1).reshape(-1, 1, 2)
    points = boxes[:, :2] + at * (boxes[:, 2:] - boxes[:, :2])  # (points, n, 2)
    within = np.zeros(points.shape[:2], bool)
    for other in others:  # there may be hundreds
        within |= ((points >= other[:2]) & (points <= other[2:])).all(axis=-1)
    return np.asarray(within.mean(axis=0))


def box_area(xyxy: Float[Array, "*n 4"]) -> Float[Array, "*n"]:
    """Square pixels; 0 where the corners are the wrong way round."""
    return np.asarray(np.clip(xyxy[..., 2:] - xyxy[..., :2], 0, None).prod(axis=-1))


def box_size(xyxy: Float[Array, "*n 4"]) -> Float[Array, "*n"]:
    """The root of a box's area, pixels, 1 at least: the size of a body, of which movements are fractions."""
    return np.asarray(np.sqrt(np.maximum(box_area(xyxy), 1.0)))
