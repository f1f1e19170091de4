"""One person in one frame: what of the network's output is kept, and how far it can be trusted."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from humanmm.models.perception.interfaces import Landmarks
from humanmm.models.perception.regions import Region, invert, transform
from humanmm.models.records import landmarks
from humanmm.models.records.tracks import MASK_SIDE

MIN_PRESENCE = 0.6
MIN_SHOULDER_VISIBILITY = 0.6
MIN_TORSO = 0.05
"""Least distance from mid-shoulder to mid-hip as a fraction of the region's side; a standing person has 0.23."""
MIN_CONFIDENCE = 0.15
"""Of the most that somebody could have who is out of the frame where this one is: head and shoulders have 0.2."""
_MASK_ON = 128
_MASK_REACH = 3


@dataclass(frozen=True)
class Observation:
    """One person in one frame; coordinates in pixels of the picture."""

    keypoints: Float[np.ndarray, "33 3"]
    landmarks3d: Float[np.ndarray, "33 3"]
    bbox: Float[np.ndarray, " 4"]
    confidence: float
    mask: UInt8[np.ndarray, "mask mask"]
    """1 where the person is."""
    region: Region
    next_region: Region
    keypoint_sigma: Float[np.ndarray, " 33"] | None = None
    """Expected errors of the keypoints, each axis, pixels; None if unknown."""
    side_odds: float = 0.0
    """Log-odds that left and right are named rightly, by another network; 0 without one."""

    @property
    def mask_to_source(self) -> Float[np.ndarray, "2 3"]:
        """Mask pixels to the picture's."""
        return self.region.to_source(MASK_SIDE)


def observe(output: Landmarks, frame_size: tuple[int, int]) -> Observation | None:
    """The observation in a network's output, or None where the crop holds no usable person.

    Presence alone is no gate: a loudspeaker scores 0.95, and a face that fills the frame gives a confident body that
    is not there. A usable person shows the shoulders inside the frame, and the landmarks lie on the mask.
    """
    mask = (output.mask >= _MASK_ON).astype(np.uint8)
    confidence = _confidence(output, mask, frame_size)
    if confidence == 0 or confidence < MIN_CONFIDENCE * _trust(inside(output.keypoints[:, :2], frame_size)):
        return None
    bbox = _visible_box(output.keypoints, mask, output.region, frame_size)
    if bbox is None:
        return None
    keypoints = output.keypoints
    if output.agreement is not None:
        keypoints = keypoints * np.column_stack([np.ones((len(keypoints), 2)), output.agreement])
    return Observation(
        keypoints, output.landmarks3d, bbox, confidence, mask, output.region, output.next_region, output.keypoint_sigma,
        output.side_odds,
    )  # fmt: skip


def averaged(a: Landmarks, b: Landmarks) -> Landmarks:
    """The mean of two outputs for one region: the network's errors on a picture and on its mirror image differ."""
    return replace(
        a,
        keypoints=(a.keypoints + b.keypoints) / 2,
        landmarks3d=(a.landmarks3d + b.landmarks3d) / 2,
        mask=((a.mask.astype(np.uint16) + b.mask) // 2).astype(np.uint8),
        keypoint_sigma=_mean(a.keypoint_sigma, b.keypoint_sigma),
        agreement=_mean(a.agreement, b.agreement),
    )


def _mean(a: Float[np.ndarray, " 33"] | None, b: Float[np.ndarray, " 33"] | None) -> Float[np.ndarray, " 33"] | None:
    return None if a is None or b is None else (a + b) / 2


def inside(points: Float[np.ndarray, "n 2"], frame_size: tuple[int, int]) -> Bool[np.ndarray, " n"]:
    """Which points lie in the frame (width, height)."""
    within = (points >= 0) & (points <= np.array(frame_size))
    return np.asarray(within.all(axis=-1))


def on_mask(
    points: Float[np.ndarray, "n 2"], mask: UInt8[np.ndarray, "mask mask"], region: Region
) -> Bool[np.ndarray, " n"]:
    """Which points lie on the mask or within a few mask pixels of it."""
    grown = cv2.dilate(mask, np.ones((2 * _MASK_REACH + 1, 2 * _MASK_REACH + 1), np.uint8))
    cells = np.floor(transform(invert(region.to_source(MASK_SIDE)), points)).astype(int)
    valid = ((cells >= 0) & (cells < MASK_SIDE)).all(axis=1)
    cells = np.clip(cells, 0, MASK_SIDE - 1)
    return np.asarray(valid & (grown[cells[:, 1], cells[:, 0]] > 0))


def _confidence(output: Landmarks, mask: UInt8[np.ndarray, "mask mask"], frame_size: tuple[int, int]) -> float:
    """How far the pose can be trusted, 0..1: torso seen × legs seen × limbs on the mask; 0 for an unusable person."""
    keypoints = output.keypoints
    seen = keypoints[:, 2] * inside(keypoints[:, :2], frame_size)
    hips, shoulders = keypoints[list(landmarks.HIPS), :2], keypoints[list(landmarks.SHOULDERS), :2]
    trunk = float(np.linalg.norm(shoulders.mean(axis=0) - hips.mean(axis=0)))
    if (
        output.presence < MIN_PRESENCE
        or float(seen[list(landmarks.SHOULDERS)].mean()) < MIN_SHOULDER_VISIBILITY
        or trunk < MIN_TORSO * output.region.side
    ):
        return 0.0
    limbs = list(landmarks.LIMBS)
    agreement = on_mask(keypoints[limbs, :2], mask, output.region) @ seen[limbs] / max(float(seen[limbs].sum()), 1e-6)
    return float(_trust(seen) * agreement**2)


def _trust(seen: Float[np.ndarray, " 33"] | Bool[np.ndarray, " 33"]) -> float:
    """How far a body can be trusted of which so much is seen, 0..1: torso seen × legs seen."""
    torso = float(seen[list(landmarks.TORSO)].mean())
    legs = float(seen[[*landmarks.KNEES, *landmarks.ANKLES]].mean())
    return torso * (0.4 + 0.6 * legs)


def _visible_box(
    keypoints: Float[np.ndarray, "33 3"],
    mask: UInt8[np.ndarray, "mask mask"],
    region: Region,
    frame_size: tuple[int, int],
) -> Float[np.ndarray, " 4"] | None:
    """xyxy of the mask near the visible keypoints, inside the frame; None when nothing is left."""
    visible = keypoints[keypoints[:, 2] > landmarks.VISIBLE, :2]
    if len(visible) < 4:
        return None
    low, high = visible.min(axis=0), visible.max(axis=0)
    reach = 0.12 * float(np.max(high - low))
    rows, columns = np.nonzero(mask)
    if len(rows):
        pixels = transform(region.to_source(MASK_SIDE), np.column_stack([columns, rows]) + 0.5)
        near = pixels[((pixels >= low - reach) & (pixels <= high + reach)).all(axis=1)]
        if len(near):
            low, high = np.minimum(low, near.min(axis=0)), np.maximum(high, near.max(axis=0))
    low, high = np.clip(low, 0, frame_size), np.clip(high, 0, frame_size)
    if (high - low).min() < 4:
        return None
    return np.concatenate([low, high])


def similarity(a: Float[np.ndarray, "33 3"], b: Float[np.ndarray, "33 3"], side: float) -> float:
    """Object keypoint similarity of two poses over the 12 limb landmarks, 1 for equal; side: the region's."""
    limbs = list(landmarks.LIMBS)
    weight = np.minimum(a[limbs, 2], b[limbs, 2]) + 1e-3
    squared = ((a[limbs, :2] - b[limbs, :2]) ** 2).sum(axis=1)
    return float((np.exp(-squared / (2 * (0.06 * side) ** 2)) * weight).sum() / weight.sum())
