"""One person in one frame: what of the network's answer is kept, and how far it can be trusted."""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from humanmm.models.perception import landmarks
from humanmm.models.perception.networks import Landmarks
from humanmm.models.perception.regions import Region, crop, invert, transform
from humanmm.models.perception.tracks import MASK_SIDE

MIN_PRESENCE = 0.6
MIN_TORSO_VISIBILITY = 0.6
MIN_CONFIDENCE = 0.25
VISIBLE = 0.5
_MASK_ON = 128

HUE_BINS, SATURATION_BINS, GREY_BINS = 12, 3, 4
HISTOGRAM_BINS = 2 * (HUE_BINS * SATURATION_BINS + GREY_BINS)
"""Colours of the upper and of the lower body: hue × saturation, or brightness where there is no colour."""


@dataclass(frozen=True)
class Observation:
    """One person in one frame; coordinates in source pixels."""

    keypoints: Float[np.ndarray, "33 3"]
    landmarks3d: Float[np.ndarray, "33 3"]
    bbox: Float[np.ndarray, "4"]
    confidence: float
    mask: UInt8[np.ndarray, "mask mask"]
    """1 where the person is."""
    region: Region
    next_region: Region

    @property
    def mask_to_source(self) -> Float[np.ndarray, "2 3"]:
        return self.region.to_source(MASK_SIDE)

    @property
    def height(self) -> float:
        """Of the visible body's box, in pixels."""
        return float(self.bbox[3] - self.bbox[1])


def observe(answer: Landmarks, frame_size: tuple[int, int]) -> Observation | None:
    """The observation in a network's answer, or None where the crop holds no usable person.

    Presence alone is no gate: a loudspeaker scores 0.95, and a face that fills the frame gives a confident body that
    is not there. A usable person shows most of the torso inside the frame, and the landmarks lie on the mask.
    """
    confidence = _confidence(answer, frame_size)
    if confidence < MIN_CONFIDENCE:
        return None
    mask = (answer.mask >= _MASK_ON).astype(np.uint8)
    bbox = _visible_box(answer.keypoints, mask, answer.region, frame_size)
    if bbox is None:
        return None
    return Observation(answer.keypoints, answer.landmarks3d, bbox, confidence, mask, answer.region, answer.next_region)


def inside(points: Float[np.ndarray, "n 2"], frame_size: tuple[int, int], margin: float = 0.0) -> np.ndarray:
    """Which points lie in the frame (width, height), or at most `margin` pixels outside."""
    within: np.ndarray = (points >= -margin) & (points <= np.array(frame_size) + margin)
    return np.asarray(within.all(axis=-1))


def on_mask(keypoints: Float[np.ndarray, "n 3"], mask: np.ndarray, region: Region, reach: int = 5) -> np.ndarray:
    """Which keypoints lie on the mask or within `reach` mask pixels of it."""
    grown = cv2.dilate(mask, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8))
    cells = np.floor(transform(invert(region.to_source(MASK_SIDE)), keypoints[:, :2])).astype(int)
    valid = ((cells >= 0) & (cells < MASK_SIDE)).all(axis=1)
    cells = np.clip(cells, 0, MASK_SIDE - 1)
    result: np.ndarray = valid & (grown[cells[:, 1], cells[:, 0]] > 0)
    return result


def _confidence(answer: Landmarks, frame_size: tuple[int, int]) -> float:
    """How far the pose can be trusted, 0..1: presence × torso seen × limbs seen × landmarks on the mask."""
    keypoints = answer.keypoints
    torso = keypoints[list(landmarks.TORSO)]
    if answer.presence < MIN_PRESENCE or torso[:, 2].mean() < MIN_TORSO_VISIBILITY:
        return 0.0
    margin = 0.03 * answer.region.side
    torso_inside = inside(torso[:, :2], frame_size, margin).mean()
    hips_inside = inside(torso[2:, :2], frame_size, margin).mean()
    if torso_inside < 0.75 or hips_inside < 0.5:
        return 0.0
    limbs = keypoints[list(landmarks.LIMBS)]
    seen = limbs[:, 2] * inside(limbs[:, :2], frame_size)
    mask = (answer.mask >= _MASK_ON).astype(np.uint8)
    on = on_mask(limbs, mask, answer.region)
    agreement = float((on * seen).sum() / max(float(seen.sum()), 1e-6))
    return float(answer.presence * torso[:, 2].mean() * (0.4 + 0.6 * seen.mean()) * agreement**2)


def _visible_box(
    keypoints: Float[np.ndarray, "33 3"], mask: np.ndarray, region: Region, frame_size: tuple[int, int]
) -> Float[np.ndarray, "4"] | None:
    """xyxy of the mask near the visible keypoints, inside the frame; None when nothing is left."""
    visible = keypoints[keypoints[:, 2] > VISIBLE, :2]
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


def clothing_histogram(image: UInt8[np.ndarray, "height width 3"], seen: Observation) -> Float[np.ndarray, "bins"]:
    """Colours on the mask above and below the hips, each half summing to 0.5 (0 where nothing of it is seen)."""
    picture = cv2.cvtColor(crop(image, seen.region, MASK_SIDE), cv2.COLOR_RGB2HSV)
    core = cv2.erode(seen.mask, np.ones((3, 3), np.uint8)) > 0
    to_mask = invert(seen.mask_to_source)
    torso = transform(to_mask, seen.keypoints[list(landmarks.TORSO), :2])
    shoulders, hips = torso[:2].mean(axis=0), torso[2:].mean(axis=0)
    axis = hips - shoulders
    y, x = np.mgrid[0:MASK_SIDE, 0:MASK_SIDE] + 0.5
    along = ((x - shoulders[0]) * axis[0] + (y - shoulders[1]) * axis[1]) / max(float(axis @ axis), 1e-6)
    hue = picture[..., 0].astype(int) * HUE_BINS // 180
    saturation = picture[..., 1].astype(int)
    grey = HUE_BINS * SATURATION_BINS + picture[..., 2].astype(int) * GREY_BINS // 256
    colour = hue * SATURATION_BINS + np.minimum((saturation - 40) * SATURATION_BINS // 216, SATURATION_BINS - 1)
    label = np.where((saturation < 40) | (picture[..., 2] < 40), grey, colour)
    bins = HUE_BINS * SATURATION_BINS + GREY_BINS
    halves = []
    for part in ((along > 0) & (along <= 1), (along > 1) & (along <= 3)):
        counts = np.bincount(label[core & part], minlength=bins).astype(float)
        halves.append(0.5 * counts / max(counts.sum(), 1.0))
    return np.concatenate(halves)
