"""What a person detector and a pose network take and return; positions in source pixels, centres at (0.5, 0.5).

`people.detector` and `people.pose` choose them by name (docs/extend.md); the default is BlazePose (`networks`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from jaxtyping import Float, UInt8

from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import Region


@dataclass(frozen=True)
class Detection:
    """A person seen by the detector."""

    score: float
    region: Region
    """Where to look for the landmarks."""
    box: Float[np.ndarray, " 4"]
    """xyxy of the head and shoulders, source pixels."""


@dataclass(frozen=True)
class Landmarks:
    """Output of the landmark network for one crop."""

    keypoints: Float[np.ndarray, "33 3"]
    """x, y in source pixels, visibility 0..1."""
    landmarks3d: Float[np.ndarray, "33 3"]
    """Metres about the mid-hip, axes of the picture: x right, y down, z away."""
    presence: float
    """Probability that the crop holds a person."""
    mask: UInt8[np.ndarray, "mask mask"]
    """Probability × 255 of each mask pixel being the person; the crop's region, MASK_SIDE pixels a side."""
    region: Region
    """The crop."""
    next_region: Region
    """Where the network sees the body: the crop for the next frame."""


class PersonDetector(Protocol):
    """Finds people in a picture."""

    def __call__(self, image: Picture, within: Region) -> Sequence[Detection]:
        """People in an upright square region of the picture, best first, one detection a person."""
        ...


class PoseNetwork(Protocol):
    """Finds the landmarks of the person who fills a region."""

    def __call__(self, image: Picture, region: Region, *, mirrored: bool = False) -> Landmarks:
        """33 landmarks (`records.landmarks`) in the picture and in space, and the person's mask.

        With `mirrored` the network is shown the mirror image of the crop; what it finds is given in the picture as it
        is, with left and right named as seen there.
        """
        ...


@dataclass(frozen=True)
class Networks:
    """The two networks by which people are followed."""

    detect: PersonDetector
    locate: PoseNetwork
