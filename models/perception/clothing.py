"""Clothing colours: they distinguish people whom pose and position do not."""

import cv2
import numpy as np
from jaxtyping import Float

from humanmm.models.perception.observation import Observation
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import invert, transform
from humanmm.models.records import landmarks

HUES, SATURATIONS, GREYS = 12, 3, 4
_PART = HUES * SATURATIONS + GREYS
HISTOGRAM_BINS = 2 * _PART
"""Colours of the upper and of the lower body: hue × saturation, or brightness where there is no colour."""

_FAINT, _DARK = 40, 40
"""Below this saturation or brightness (of 255) a hue means nothing."""
_SIDE = 64


def clothing_histogram(image: Picture, seen: Observation) -> Float[np.ndarray, " bins"]:
    """Colours on the mask above and below the hips, each half summing to 0.5 (0 where nothing of it is seen)."""
    picture = cv2.cvtColor(image.crop(seen.region, _SIDE), cv2.COLOR_RGB2HSV).astype(np.int64)
    mask = cv2.resize(cv2.erode(seen.mask, np.ones((3, 3), np.uint8)), (_SIDE, _SIDE), interpolation=cv2.INTER_NEAREST)
    torso = transform(invert(seen.region.to_source(_SIDE)), seen.keypoints[list(landmarks.TORSO), :2])
    shoulders, hips = torso[:2].mean(axis=0), torso[2:].mean(axis=0)
    axis = hips - shoulders
    y, x = np.mgrid[0:_SIDE, 0:_SIDE] + 0.5
    along = ((x - shoulders[0]) * axis[0] + (y - shoulders[1]) * axis[1]) / max(float(axis @ axis), 1e-6)
    hue, saturation, brightness = picture[..., 0], picture[..., 1], picture[..., 2]
    colour = (hue * HUES // 180) * SATURATIONS + np.clip((saturation - _FAINT) * SATURATIONS // 216, 0, SATURATIONS - 1)
    grey = HUES * SATURATIONS + brightness * GREYS // 256
    label = np.where((saturation < _FAINT) | (brightness < _DARK), grey, colour)
    halves = []
    for part in ((along > 0) & (along <= 1), (along > 1) & (along <= 3)):
        counts = np.bincount(label[(mask > 0) & part], minlength=_PART).astype(np.float64)
        halves.append(0.5 * counts / max(float(counts.sum()), 1.0))
    return np.concatenate(halves)


def mean_colours(samples: Float[np.ndarray, "samples bins"]) -> Float[np.ndarray, " bins"]:
    """One histogram of many, summing to 1 (0 when nothing was seen)."""
    total = np.asarray(samples, np.float64).sum(axis=0)
    return np.asarray(total / max(float(total.sum()), 1e-9))


def colour_distance(a: Float[np.ndarray, " bins"], b: Float[np.ndarray, " bins"]) -> float:
    """Hellinger distance of two histograms that sum to 1: 0 equal, 1 nothing in common."""
    return float(np.sqrt(max(0.0, 1 - float(np.sqrt(a * b).sum()))))
