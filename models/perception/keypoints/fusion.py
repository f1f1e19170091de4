"""BlazePose and Thunder on one crop: each names what the other misses.

Errors of the 12 limb keypoints, median and p90 in % of the person's height, of the real clip A: BlazePose heavy 1.8 and
3.8, Thunder 1.9 and 3.6, fused 1.7 and 3.5; of four rendered clips 1.5 and 3.7, 2.0 and 5.0, 1.5 and 3.7
(docs/measurements/perception.md). BlazePose alone has depth, feet, hands, face, mask and the region to look at next.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float, UInt8

from humanmm.models.perception import movenet
from humanmm.models.perception.blazepose import crop_of, decode_heavy
from humanmm.models.perception.interfaces import Landmarks, Networks
from humanmm.models.perception.keypoints.naming import named_as, side_odds
from humanmm.models.perception.keypoints.refine import Look, with_refined
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import HEIGHT_OF_SIDE, Region
from humanmm.models.records import landmarks

APART = 0.08
"""Distance between the two, as a fraction of the height, from which one alone is believed: of wrists BlazePose, nearer
the truth in 68 % of 31, of other limbs Thunder, nearer in 50 to 82 % (scripts/measure_fusion)."""
THUNDER = 0.3
"""How far from BlazePose's limb towards Thunder's the fused one lies, else."""
CREDIBLE = 0.35
"""Score from which Thunder is believed."""
AGREED, DOUBT, LEAST_TRUST = 0.06, 25.0, 0.3
"""Up to AGREED (a fraction of the height) apart a limb is as sure as BlazePose calls it; its visibility falls by DOUBT
for a height more, to LEAST_TRUST of it. Of 10,170 visible limbs of three rendered clips the fused ones are off by 3 to
4 % of the height (root mean square) up to 6 % apart, by 6 % up to 8 %, by 11 % up to 12 %, by 18 % above."""
_LIMBS = np.array(landmarks.LIMBS)
_IS_WRIST = np.isin(_LIMBS, landmarks.WRISTS)
_ENDS = [(end, landmarks.LIMBS.index(limb)) for limb, ends in landmarks.BEYOND.items() for end in ends]
_MOVED = np.array([*landmarks.LIMBS, *(end for end, _ in _ENDS)])
_MOVED_WITH = np.array([*range(len(_LIMBS)), *(limb for _, limb in _ENDS)])
"""Landmarks that Thunder moves (limbs, hands, feet), and the limb of LIMBS that each moves with."""


def locate_best(image: Picture, region: Region, *, mirrored: bool = False) -> Landmarks:
    """Landmarks by BlazePose heavy, limbs in the picture by it and Thunder; see `PoseNetwork`."""
    return located_in(crop_of(image, region, mirrored=mirrored), region, mirrored=mirrored)


def located_in(
    crop: UInt8[np.ndarray, "256 256 3"],
    region: Region,
    *,
    mirrored: bool = False,
) -> Landmarks:
    """The same of the region's crop."""
    joined, look = joined_of(crop, region, mirrored=mirrored)
    return with_refined(joined, look, mirrored=mirrored)


def joined_of(
    crop: UInt8[np.ndarray, "256 256 3"],
    region: Region,
    *,
    mirrored: bool = False,
) -> tuple[Landmarks, Look]:
    """The same before keypoints are refined, and what the refiner goes by."""
    output, blazepose_inside = decode_heavy(crop, region, mirrored=mirrored)
    points, thunder_inside = movenet.coco_keypoints(crop, region, mirrored=mirrored)
    limbs = points[list(landmarks.COCO_LIMBS)]
    named = named_as(output.keypoints, limbs, region.side)
    keypoints, agreement = fused(output.keypoints, named, region.side)
    joined = replace(
        output,
        keypoints=keypoints,
        agreement=agreement,
        side_odds=side_odds(output.keypoints, limbs, region.side),
    )
    is_exchanged = (named[:, :2] != limbs[:, :2]).any(axis=1)
    return joined, Look(output, named, is_exchanged, blazepose_inside, thunder_inside)


def fused(
    keypoints: Float[np.ndarray, "33 3"], limbs: Float[np.ndarray, "12 3"], side: float
) -> tuple[Float[np.ndarray, "33 3"], Float[np.ndarray, " 33"]]:
    """BlazePose's keypoints with the limbs between them and Thunder's (`named_as` BlazePose's), and factors of their
    visibility.

    `side` is the region's. Where Thunder's score is low BlazePose's stays, where the two are far apart one is taken;
    the farther apart, the lower the factor. Hands and feet move with their wrists and ankles.
    """
    own = keypoints[_LIMBS, :2]
    apart = np.linalg.norm(limbs[:, :2] - own, axis=1)
    height = HEIGHT_OF_SIDE * side
    share = np.where(apart > APART * height, ~_IS_WRIST, THUNDER) * (limbs[:, 2] > CREDIBLE)
    shift = share[:, None] * (limbs[:, :2] - own)
    trust = np.clip(1 - DOUBT * (apart / height - AGREED), LEAST_TRUST, 1)
    result, agreement = keypoints.copy(), np.ones(len(keypoints))
    result[_MOVED, :2] += shift[_MOVED_WITH]
    agreement[_MOVED] = trust[_MOVED_WITH]
    return result, agreement


BEST = Networks(movenet.detect, locate_best)
"""What `people.detector` and `people.pose` name when nothing is set."""
