"""One person's observations over one scene, frame by frame."""

from dataclasses import dataclass, field

import numpy as np

MASK_SIDE = 128
"""Masks are MASK_SIDE × MASK_SIDE pictures of the person's crop, packed to bits along the last axis."""


@dataclass(frozen=True)
class PersonTrack:
    """Observations of one person; N frames, strictly increasing, holes allowed (frames where the person is not seen).

    Pixels have their centres at (0.5, 0.5) and belong to the upright source picture.
    """

    frame: np.ndarray
    """(N,) int32, index into the video."""
    keypoints2d: np.ndarray
    """(N,33,3) float32: x, y in source pixels, visibility 0..1; order as in `landmarks.NAMES`."""
    landmarks3d: np.ndarray
    """(N,33,3) float32: metres about the mid-hip, as the network gives them but turned back by the crop's in-plane
    angle: orthographic about the crop's centre, axes parallel to the viewing ray's (x right, y down, z away)."""
    bbox: np.ndarray
    """(N,4) float32: xyxy, source pixels, of the visible body."""
    confidence: np.ndarray
    """(N,) float32, 0..1: torso and legs seen, limbs on the mask, limbs moving steadily."""
    mask_bits: np.ndarray
    """(N,128,16) uint8: silhouette in the crop, np.unpackbits(axis=-1)."""
    mask_affine: np.ndarray
    """(N,2,3) float32: mask pixel coordinates (centres at .5) to source pixels."""
    color_frame: np.ndarray
    """(S,) int32: frames at which the clothing colours were taken, a few a second."""
    color_histogram: np.ndarray
    """(S,B) float32: clothing colours, upper and lower body; rows sum to about 1."""
    side_votes: np.ndarray = field(default_factory=lambda: np.zeros(0, np.float32))
    """(N,) float32: log-odds that left and right are named rightly, from second looks at an upright crop; 0 in frames
    without one, empty where nobody looked. Labels are already consistent along the track (`perception.sides`)."""


@dataclass(frozen=True)
class ScenePeople:
    """All person tracks of one scene [start, end)."""

    start: int
    end: int
    tracks: tuple[PersonTrack, ...]
