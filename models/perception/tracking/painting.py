"""People painted out of a picture, so that the networks see who else is there.

A person's mask covers whoever stands close behind or before him as well: the pose network takes both for one body. If
it is known where the joints of somebody else are about, only that part of the mask is painted that is nearer to the
bones of the person to whom it belongs.
"""

from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from humanmm.models.perception.interfaces import Detection
from humanmm.models.perception.observation import Observation
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import Region, invert, transform, warp
from humanmm.models.records import landmarks
from humanmm.models.records.tracks import MASK_SIDE

_ENDS = (
    ("nose", "{}_shoulder"), ("{}_shoulder", "{}_elbow"), ("{}_elbow", "{}_wrist"), ("{}_shoulder", "{}_hip"),
    ("{}_hip", "{}_knee"), ("{}_knee", "{}_ankle"),
)  # fmt: skip
BONES = (
    landmarks.SHOULDERS,
    landmarks.HIPS,
    *(
        (landmarks.INDEX[a.format(side)], landmarks.INDEX[b.format(side)])
        for side in ("left", "right")
        for a, b in _ENDS
    ),
)
"""Of the landmarks that COCO names as well."""
DRAWN = 0.1
"""Visibility, or score, of both ends from which a bone counts."""
GRAY = 127
"""Of the paint, as networks see it."""


def detected_keypoints(detection: Detection) -> Float[np.ndarray, "33 3"] | None:
    """What a detector sees of somebody, as landmarks; those that COCO does not name have no visibility."""
    if detection.keypoints is None:
        return None
    points = np.zeros((landmarks.NUM_LANDMARKS, 3))
    points[list(landmarks.COCO_LANDMARKS)] = detection.keypoints
    return points


def paint_out(
    canvas: Picture,
    person: Observation,
    painted: UInt8[np.ndarray, "height width"],
    *,
    spared: Float[np.ndarray, "33 3"] | None = None,
) -> None:
    """Cover the person's mask with grey, in place, but for what is nearer to the bones of somebody who is `spared`
    (his keypoints); note 1 in `painted`."""
    region = person.region
    grown = cv2.dilate(person.mask, np.ones((5, 5), np.uint8))
    if spared is not None:
        grown[_to_bones(person.keypoints, region) >= _to_bones(spared, region)] = 0
    low = np.floor([region.x - 0.75 * region.side, region.y - 0.75 * region.side]).astype(int)
    high = np.ceil([region.x + 0.75 * region.side, region.y + 0.75 * region.side]).astype(int)
    low, high = np.maximum(low - low % 2, 0), np.minimum(high + high % 2, canvas.size)
    if (high - low).min() <= 0:
        return
    matrix = region.to_source(MASK_SIDE)
    matrix[:, 2] += matrix[:, :2] @ np.array([0.5, 0.5]) - 0.5 - low
    covered = cv2.warpAffine(grown, matrix, (int(high[0] - low[0]), int(high[1] - low[1])), flags=cv2.INTER_NEAREST)
    canvas.paint(int(low[0]), int(low[1]), covered, GRAY)
    marked = painted[low[1] : high[1], low[0] : high[0]]
    np.maximum(marked, covered, out=marked)


def without(
    image: Picture, people: Sequence[Observation], *, spared: Float[np.ndarray, "33 3"] | None = None
) -> tuple[Picture, UInt8[np.ndarray, "height width"]]:
    """A copy of the picture with people painted out, as `paint_out` does, and 1 where there is paint."""
    canvas, painted = image.copy(), np.zeros((image.height, image.width), np.uint8)
    for person in people:
        paint_out(canvas, person, painted, spared=spared)
    return canvas, painted


def _to_bones(keypoints: Float[np.ndarray, "33 3"], region: Region) -> Float[np.ndarray, "mask mask"]:
    """Distance of each pixel of a region's mask from somebody's nearest bone, mask pixels; infinite without any."""
    free = np.full((MASK_SIDE, MASK_SIDE), 255, np.uint8)
    points = transform(invert(region.to_source(MASK_SIDE)), keypoints[:, :2]) - 0.5
    ends = np.clip(np.rint(points), -4 * MASK_SIDE, 4 * MASK_SIDE).astype(int).tolist()
    for a, b in BONES:
        if min(keypoints[a, 2], keypoints[b, 2]) > DRAWN:
            cv2.line(free, ends[a], ends[b], 0)
    if free.all():
        return np.full((MASK_SIDE, MASK_SIDE), np.inf)
    return np.asarray(cv2.distanceTransform(free, cv2.DIST_L2, 3), np.float64)


def covered_fraction(painted: UInt8[np.ndarray, "height width"], person: Observation) -> float:
    """Fraction of the person's mask that lies on paint."""
    size = (person.mask.shape[1], person.mask.shape[0])
    paint = warp(painted, person.mask_to_source, size, nearest=True)
    return float((paint * person.mask).sum() / max(int(person.mask.sum()), 1))
