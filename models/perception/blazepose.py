"""The BlazePose landmark networks: 33 landmarks and a mask for one person's crop.

Outputs are decoded to source pixels (centres at (0.5, 0.5)). A landmark's coordinates, which a network regresses, are
moved to the middle of what its heat map shows about them, as MediaPipe does, for which the networks were made.
"""

from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from humanmm.models.perception.interfaces import Landmarks
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import Region, body_region, transform
from humanmm.models.perception.runtime.networks import network
from humanmm.models.records import landmarks
from humanmm.models.records.tracks import MASK_SIDE

LANDMARK_SIDE = 256
FULL, HEAVY = "pose_landmark_full.tflite", "pose_landmark_heavy.tflite"
_VALUES_PER_LANDMARK = 5
_CELL = 4
"""Pixels of the crop from one cell of a heat map to the next."""
_AROUND = np.arange(-3, 4)
"""Cells about a landmark in which its heat map is looked at."""
_WARM = 0.5
"""Largest value there, the peak, from which a heat map is believed."""
_SHARPEST, _BLUNTER = 0.0026, 4.4
"""Expected error of a landmark at a peak of 1, sides of the crop, and how fast its logarithm grows as the peak falls
(docs/measurements/perception.md). Where keypoints are refined, the refiner foretells the errors of limbs, feet and
hands."""
_AUXILIARY = slice(33, 35)
"""Landmarks 33 and 34 are no body parts: hip centre and a point on the circle that holds the body."""


class Inside(NamedTuple):
    """What the largest network's inner layers show of a crop, channels last; left and right as the crop shows them."""

    fine: Float[np.ndarray, "64 64 48"]
    """Features from which the heat maps are made."""
    coarse: Float[np.ndarray, "32 32 96"]
    """Features beneath the landmarks."""
    heat_logits: Float[np.ndarray, "64 64 39"]


def sigmoid(x: np.ndarray) -> np.ndarray:
    """Of logits of any size."""
    result: np.ndarray = 1 / (1 + np.exp(-np.clip(x, -80, 80)))
    return result


def locate_full(image: Picture, region: Region, *, mirrored: bool = False) -> Landmarks:
    """Landmarks and mask by the middle one of the three networks; see `PoseNetwork`."""
    return decode(FULL, crop_of(image, region, mirrored=mirrored), region, mirrored=mirrored)


def locate_heavy(image: Picture, region: Region, *, mirrored: bool = False) -> Landmarks:
    """Landmarks and mask by the largest of the three networks; see `PoseNetwork`."""
    return decode(HEAVY, crop_of(image, region, mirrored=mirrored), region, mirrored=mirrored)


def crop_of(image: Picture, region: Region, *, mirrored: bool) -> UInt8[np.ndarray, "256 256 3"]:
    """What the networks are shown of a region."""
    crop = image.crop(region, LANDMARK_SIDE)
    return np.ascontiguousarray(crop[:, ::-1]) if mirrored else crop


def decode(model: str, crop: UInt8[np.ndarray, "256 256 3"], region: Region, *, mirrored: bool) -> Landmarks:
    """Landmarks and mask of the person in a crop of a region, by one of the networks.

    Landmarks of a mirrored crop are given in the unmirrored picture, with left and right named as seen there.
    """
    return _decoded(_run(model, crop), region, mirrored=mirrored)


def decode_heavy(crop: UInt8[np.ndarray, "256 256 3"], region: Region, *, mirrored: bool) -> tuple[Landmarks, Inside]:
    """The same by the largest network, and what it knows besides."""
    *outputs, fine, coarse = _run(HEAVY, crop, ("fine", "coarse"))
    return _decoded(outputs, region, mirrored=mirrored), Inside(fine[0], coarse[0], outputs[3][0])


def _run(model: str, crop: UInt8[np.ndarray, "256 256 3"], further: tuple[str, ...] = ()) -> list[np.ndarray]:
    return network(model).run(
        np.divide(crop[None], np.float32(255), dtype=np.float32),
        ("Identity", "Identity_1", "Identity_2", "Identity_3", "Identity_4", *further),
    )


def _decoded(outputs: list[np.ndarray], region: Region, *, mirrored: bool) -> Landmarks:
    image_points, presence, mask_logits, heat_logits, world_points = outputs
    raw = image_points.reshape(-1, _VALUES_PER_LANDMARK)
    world = world_points.reshape(-1, 3)[: landmarks.NUM_LANDMARKS].astype(np.float64)
    logits = mask_logits[0, :, :, 0]
    points, visibility = raw[:35, :2].astype(np.float64), sigmoid(raw[: landmarks.NUM_LANDMARKS, 3])
    points[: landmarks.NUM_LANDMARKS], peaks = _refined(points[: landmarks.NUM_LANDMARKS], heat_logits[0])
    if mirrored:
        points = np.column_stack([LANDMARK_SIDE - points[:, 0], points[:, 1]])
        points[: landmarks.NUM_LANDMARKS] = points[landmarks.SWAP]
        world = (world * [-1, 1, 1])[landmarks.SWAP]
        visibility, peaks, logits = visibility[landmarks.SWAP], peaks[landmarks.SWAP], logits[:, ::-1]
    in_source = transform(region.to_source(LANDMARK_SIDE), points)
    c, s = np.cos(region.angle), np.sin(region.angle)
    rotated = np.column_stack([c * world[:, 0] - s * world[:, 1], s * world[:, 0] + c * world[:, 1], world[:, 2]])
    mask = cv2.resize(np.ascontiguousarray(logits), (MASK_SIDE, MASK_SIDE), interpolation=cv2.INTER_AREA)
    return Landmarks(
        keypoints=np.column_stack([in_source[: landmarks.NUM_LANDMARKS], visibility]),
        landmarks3d=rotated,
        presence=float(presence.item()),
        mask=(255 * sigmoid(mask)).astype(np.uint8),
        region=region,
        next_region=body_region(*in_source[_AUXILIARY]),
        keypoint_sigma=region.side * _SHARPEST * np.exp(_BLUNTER * (1 - peaks)),
    )


def _refined(
    points: Float[np.ndarray, "33 2"], heat_logits: Float[np.ndarray, "rows columns _"]
) -> tuple[Float[np.ndarray, "33 2"], Float[np.ndarray, " 33"]]:
    """Landmarks, pixels of the crop, each in the middle of what its heat map shows about it, if that is warm; peaks."""
    cell, last = np.floor(points / _CELL).astype(int), np.array(heat_logits.shape[1::-1]) - 1
    around = cell[:, :, None] + _AROUND
    columns, rows = np.minimum(np.maximum(around, 0), last[:, None]).transpose(1, 0, 2)
    heat = sigmoid(heat_logits[rows[:, :, None], columns[:, None], np.arange(len(points))[:, None, None]])
    is_inside = np.asarray(((cell >= 0) & (cell <= last)).all(axis=1))
    heat *= is_inside[:, None, None] & (columns == around[:, 0])[:, None] & (rows == around[:, 1])[:, :, None]
    weight = np.maximum(heat.sum(axis=(1, 2)), 1e-9)
    middle = np.column_stack([
        (heat.sum(axis=1) * columns).sum(axis=1) / weight, (heat.sum(axis=2) * rows).sum(axis=1) / weight,
    ])  # fmt: skip
    peaks = heat.max(axis=(1, 2))
    return np.where(peaks[:, None] >= _WARM, _CELL * middle, points), peaks
