"""The MoveNet networks: MultiPose sees up to six people in a picture, Thunder one person in a crop.

Both give 17 COCO keypoints. Outputs are decoded to source pixels (centres at (0.5, 0.5)).
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, UInt8

from humanmm.models.perception.interfaces import Detection
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import Region, transform
from humanmm.models.perception.runtime.networks import network
from humanmm.models.records.landmarks import COCO_HIPS, COCO_SHOULDERS, COCO_SWAP

LONG_SIDE = 384
"""Of MultiPose's input: people 80 to 250 pixels tall are found best (recall 0.93 at 384, 0.87 at 256)."""
_CELL = 32
MIN_SCORE = 0.2
REACH = 2.8
"""Side of a person's region over the distance from his hips to the farthest of his keypoints: BlazePose's circle holds
the body with arms stretched out."""
CREDIBLE = 0.2
"""Score of a keypoint that counts for the region."""
THUNDER_SIDE = 256


class Inside(NamedTuple):
    """What Thunder's inner layers show of a crop, channels last; left and right as the crop shows them."""

    features: Float[np.ndarray, "64 64 24"]
    heat_logits: Float[np.ndarray, "64 64 17"]


def detect(image: Picture, within: Region) -> list[Detection]:
    """People in an upright square region of the picture, best first, one detection a person, with their keypoints.

    The region's side is the network's long side, also where the region is larger than the picture.
    """
    low = np.maximum([within.x - within.side / 2, within.y - within.side / 2], 0)
    high = np.minimum([within.x + within.side / 2, within.y + within.side / 2], image.size)
    part, corner = image.part(low, high)
    scale = LONG_SIDE / within.side
    # shrunk by averaging; a picture smaller than the input is not enlarged by more than it must
    shown = part.reduced(min(scale, 1.0))
    height, width = (-(-side // _CELL) * _CELL for side in shown.shape[:2])
    tensor = np.zeros((1, height, width, 3), np.int32)
    tensor[0, : shown.shape[0], : shown.shape[1]] = shown
    (rows,) = network("movenet-multipose.tflite", tensor.shape).run(tensor)
    to_source = np.array(part.size) / [shown.shape[1], shown.shape[0]]
    found: list[Detection] = []
    for row in sorted(rows[0], key=lambda row: -row[55]):
        if row[55] < MIN_SCORE:
            break
        points = row[:51].reshape(17, 3)[:, [1, 0, 2]].astype(np.float64)
        points[:, :2] = points[:, :2] * [width, height] * to_source + corner
        box = row[[52, 51, 54, 53]] * np.tile([width, height] * to_source, 2) + np.tile(corner, 2)
        region = region_of(points)
        if region is None or any(other.has_box(box) for other in found):
            continue
        found.append(Detection(float(row[55]), region, box, points))
    return found


def region_of(points: Float[np.ndarray, "17 3"]) -> Region | None:
    """Where to look for the landmarks of somebody: about his hips, upright along his trunk, as wide as he reaches."""
    hips, shoulders = (points[list(pair), :2].mean(axis=0) for pair in (COCO_HIPS, COCO_SHOULDERS))
    credible = points[points[:, 2] >= CREDIBLE, :2]
    if len(credible) < 4:
        return None
    side = REACH * float(np.linalg.norm(credible - hips, axis=1).max())
    dx, dy = shoulders - hips
    return Region(float(hips[0]), float(hips[1]), side, float(np.arctan2(dx, -dy))) if side > 0 else None


def coco_keypoints(
    crop: UInt8[np.ndarray, "side side 3"], region: Region, *, mirrored: bool = False
) -> tuple[Float[np.ndarray, "17 3"], Inside]:
    """Thunder's keypoints (x, y in source pixels, score) of the person whose region the crop shows, and what it knows
    besides.

    A `mirrored` crop is the mirror image of the region; its keypoints are given as in `PoseNetwork`.
    """
    rows, *inside = network("movenet-thunder.tflite").run(crop[None].astype(np.int32), ("Identity", "features", "heat"))
    points = rows.reshape(17, 3)[:, [1, 0, 2]].astype(np.float64)
    points[:, :2] *= THUNDER_SIDE
    if mirrored:
        points[:, 0] = THUNDER_SIDE - points[:, 0]
        points = points[COCO_SWAP]
    points[:, :2] = transform(region.to_source(THUNDER_SIDE), points[:, :2])
    return points, Inside(*(tensor[0] for tensor in inside))
