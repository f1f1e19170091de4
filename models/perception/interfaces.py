"""What a person detector, a pose network and a lifter take and return.

Positions are in source pixels, pixel centres at (0.5, 0.5).

`people.detector`, `people.pose`, `lifting.method` and `lifting.keypoints` choose them by name (docs/extend.md); the
defaults are in `networks` and `lifting`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from jaxtyping import Bool, Float, UInt8

from humanmm.models.geometry.boxes import box_iou
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import Region
from humanmm.models.records.landmarks import with_sides_swapped
from humanmm.models.records.tracks import PoseEstimates

SAME_BOX = 0.6
"""Intersection over union from which two boxes of one picture are one person's."""


@dataclass(frozen=True)
class Detection:
    """A person seen by the detector."""

    score: float
    region: Region
    """Where to look for the landmarks."""
    box: Float[np.ndarray, " 4"]
    """xyxy of what the detector sees of the person, source pixels."""
    keypoints: Float[np.ndarray, "17 3"] | None = None
    """COCO keypoints (x, y in source pixels, score), if the detector gives any."""

    def has_box(self, box: Float[np.ndarray, " 4"]) -> bool:
        """True where a box of the same picture is of the same person."""
        return bool(box_iou(self.box[None], box)[0] > SAME_BOX)


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
    side_odds: float = 0.0
    """Log-odds that left and right are named rightly, from another network's look at the crop; 0 if there was none."""
    keypoint_sigma: Float[np.ndarray, " 33"] | None = None
    """Expected errors of the keypoints, each axis, source pixels; None if the network does not say."""
    agreement: Float[np.ndarray, " 33"] | None = None
    """Factor of each visibility, for what another network says of the place; None if there was none. Whether somebody
    is there at all does not depend on it."""


class PersonDetector(Protocol):
    """Finds people in a picture."""

    def __call__(self, image: Picture, within: Region) -> Sequence[Detection]:
        """People in an upright square region, best first, one detection a person.

        The region may reach beyond the picture: who fills the picture is also looked at as if from farther away.
        """
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


SEEN = 0.1
"""A keypoint with a lower score counts as unseen. Scores above are not calibrated between detectors."""


@dataclass(frozen=True, eq=False)
class PersonFrames:
    """One person in n frames of one scene, in the order of their times; frames may be missing between them."""

    time_s: Float[np.ndarray, " n"]
    keypoints: Float[np.ndarray, "n 33 3"]
    """x, y in source pixels, visibility 0..1."""
    landmarks3d: Float[np.ndarray, "n 33 3"]
    """The pose network's, metres about the mid-hip, axes of the viewing ray."""
    centre: Float[np.ndarray, "n 2"]
    """Of the crop that the network saw, source pixels."""
    side: Float[np.ndarray, " n"]
    """Of the crop, source pixels."""
    keypoint_sigma: Float[np.ndarray, "n 33"] | None = None
    """Expected errors of the keypoints, each axis, source pixels; None where no network says."""

    def chosen(self, rows: slice) -> "PersonFrames":
        """A run of frames."""
        return replace(self, **{name: array[rows] for name, array in vars(self).items() if array is not None})

    def with_sides_swapped(self, is_swapped: Bool[np.ndarray, " n"]) -> "PersonFrames":
        """The same with left and right of some frames named the other way."""
        sigma = self.keypoint_sigma
        return replace(
            self,
            keypoints=with_sides_swapped(self.keypoints, is_swapped),
            landmarks3d=with_sides_swapped(self.landmarks3d, is_swapped),
            keypoint_sigma=None if sigma is None else with_sides_swapped(sigma, is_swapped),
        )


@dataclass(frozen=True, eq=False)
class Lifted:
    """One person in space, n frames."""

    landmarks3d: Float[np.ndarray, "n 33 3"]
    """Metres about the mid-hip, axes of the viewing ray through each frame's crop: x right, y down, z away."""
    pose: PoseEstimates | None = None
    """Joint rotations, from a lifter that knows them."""


class Lifter(Protocol):
    """Finds a person in space from what the pose networks saw of him over time."""

    def __call__(self, frames: PersonFrames, K: Float[np.ndarray, "3 3"]) -> Lifted:
        """Landmarks (`records.landmarks`) and poses in each frame, left and right named as they are in `frames`; K may
        be rough."""
        ...


class KeypointLifter(Protocol):
    """Finds a person in space of whom a detector gives COCO's 17 keypoints alone."""

    def __call__(
        self, keypoints: Float[np.ndarray, "n 17 3"], time_s: Float[np.ndarray, " n"], K: Float[np.ndarray, "3 3"]
    ) -> Lifted:
        """Landmarks (`records.landmarks`) and, if it knows them, poses in each of n frames, in the axes of the camera.

        Keypoints (pixels and score 0..1) are one person's, in the order of their times, seconds; frames may be missing
        between them. K may be rough.
        """
        ...
