"""Masks of a person in the crop that the pose network would look at: thick bones, a round head.

Only what the background tracker needs of them: that points on the person are left out.
"""

import cv2
import numpy as np
from jaxtyping import Float

from humanmm.models.perception.regions import BODY_MARGIN, Region, invert, transform
from humanmm.models.records import landmarks
from humanmm.models.records.tracks import MASK_SIDE, Silhouettes, deflated_mask

Array = np.ndarray

_BONES = (
    (11, 13), (13, 15), (12, 14), (14, 16), (15, 19), (16, 20), (23, 25), (25, 27), (24, 26), (26, 28), (27, 31),
    (28, 32), (27, 29), (28, 30),
)  # fmt: skip
LIMB, HEAD = 0.07, 0.075
"""Thickness of a limb and radius of the head, as fractions of the body's height in the picture."""


def silhouettes(keypoints: Float[Array, "n 33 c"]) -> tuple[Silhouettes, Array]:
    """Masks and their affine maps (n,2,3), as `PersonTrack` has them."""
    masks = []
    affine = np.zeros((len(keypoints), 2, 3), np.float32)
    for row, points in enumerate(keypoints[..., :2].astype(np.float64)):
        hip = points[list(landmarks.HIPS)].mean(axis=0)
        radius = float(np.linalg.norm(points - hip, axis=1).max())
        region = Region(float(hip[0]), float(hip[1]), 2 * BODY_MARGIN * max(radius, 4.0))
        to_source = region.to_source(MASK_SIDE)
        masks.append(deflated_mask(_drawn(transform(invert(to_source), points))))
        affine[row] = to_source
    return Silhouettes.of(masks), affine


def _drawn(points: Float[Array, "33 2"]) -> Array:
    mask = np.zeros((MASK_SIDE, MASK_SIDE), np.uint8)
    height = float(np.ptp(points[:, 1]))
    places = np.clip(np.floor(points), -4 * MASK_SIDE, 4 * MASK_SIDE).astype(int)
    thick = max(2, round(LIMB * height))
    for a, b in _BONES:
        cv2.line(mask, places[a].tolist(), places[b].tolist(), 1, thick)
    cv2.fillConvexPoly(mask, places[[11, 12, 24, 23]], 1)
    cv2.line(mask, places[11].tolist(), places[12].tolist(), 1, thick)
    head = places[[7, 8]].mean(axis=0).astype(int)
    cv2.circle(mask, head.tolist(), max(2, round(HEAD * height)), 1, -1)
    return mask
