"""Keypoints that two pose networks gave, moved to where their inner layers say that the landmarks are.

Both networks were taught where people click on pictures. The refiner has seen what their layers show about landmarks of
rendered bodies, whose places are known (model card weights/keypoint_refiner.md).
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.perception import blazepose, movenet
from humanmm.models.perception.blazepose import LANDMARK_SIDE
from humanmm.models.perception.interfaces import Landmarks
from humanmm.models.perception.keypoints.surroundings import REFINED, Seen
from humanmm.models.perception.regions import invert, transform
from humanmm.models.records.landmarks import LIMBS, SWAP

Array = np.ndarray

SHARE = 0.5
"""Of the way to where the refiner sees a landmark: it knows rendered people, and real ones are not quite like them
(docs/measurements/perception.md)."""

EXPECTED = 0.585
"""Of the refiner's expected errors: lifters and fits were made with those of the heat maps, which are smaller. Limbs
are off by 1.20 times the refiner's, and by 2.05 times the heat maps' (eight rendered clips; most likely factors of
Laplace's distribution)."""


@dataclass(frozen=True, eq=False)
class Look:
    """What both networks say of one crop, and what they know besides; positions in pixels of the picture."""

    output: Landmarks
    """BlazePose's."""
    limbs: Float[Array, "12 3"]
    """Thunder's x, y, score, left and right named as BlazePose does."""
    is_exchanged: Bool[Array, " 12"]
    """Limbs whose left and right Thunder names otherwise."""
    blazepose_inside: blazepose.Inside
    thunder_inside: movenet.Inside


def with_refined(joined: Landmarks, look: Look, *, mirrored: bool) -> Landmarks:
    """What was joined of both networks, with refined keypoints and the refiner's expected errors."""
    from humanmm.models.perception.keypoints.reading import refined  # imports torch, which nothing needs before

    rows = _rows(mirrored=mirrored)
    shift, expected = refined(seen_in_crop(joined, look, mirrored=mirrored))
    if mirrored:
        shift = shift * [-1, 1]
    to_picture = joined.region.to_source(LANDMARK_SIDE)
    keypoints = joined.keypoints.copy()
    keypoints[rows, :2] += SHARE * shift @ to_picture[:, :2].T
    sigma = np.array(joined.keypoint_sigma)
    sigma[rows] = EXPECTED * joined.region.side / LANDMARK_SIDE * expected
    return replace(joined, keypoints=keypoints, keypoint_sigma=sigma)


def seen_in_crop(joined: Landmarks, look: Look, *, mirrored: bool) -> Seen:
    """The refiner's input."""
    rows, output, region = _rows(mirrored=mirrored), look.output, joined.region
    to_crop = invert(region.to_source(LANDMARK_SIDE))

    def in_crop(points: Float[Array, "33 _"]) -> Float[Array, "22 2"]:
        own = transform(to_crop, points[rows, :2])
        return np.column_stack([LANDMARK_SIDE - own[:, 0], own[:, 1]]) if mirrored else own

    thunder, limbs = output.keypoints.copy(), list(LIMBS)
    thunder[:, 2], is_crossed = 0.0, np.zeros(len(thunder), bool)
    thunder[limbs], is_crossed[limbs] = look.limbs, look.is_exchanged
    return Seen(
        blazepose=in_crop(output.keypoints),
        thunder=in_crop(thunder),
        fused=in_crop(joined.keypoints),
        visibility=output.keypoints[rows, 2],
        sigma=np.array(output.keypoint_sigma)[rows] / region.side,
        score=thunder[rows, 2],
        is_crossed=is_crossed[rows],
        blazepose_inside=look.blazepose_inside,
        thunder_inside=look.thunder_inside,
    )


def _rows(*, mirrored: bool) -> Array:
    """Of the picture's landmarks, those that are REFINED's in the crop."""
    return SWAP[list(REFINED)] if mirrored else np.array(REFINED)
