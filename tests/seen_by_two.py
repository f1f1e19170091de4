"""Somebody's landmarks as one network has them, and his limbs as another one has."""

import numpy as np

from humanmm.models.perception.regions import HEIGHT_OF_SIDE
from humanmm.models.records import landmarks

SIDE = 100 / HEIGHT_OF_SIDE  # of the region of a person 100 pixels tall
LIMBS = list(landmarks.LIMBS)


def body() -> np.ndarray:
    rng = np.random.default_rng(0)
    return np.column_stack([rng.uniform(0, 40, 33), rng.uniform(0, 100, 33), np.full(33, 0.9)])


def thunder(keypoints: np.ndarray) -> np.ndarray:
    return np.column_stack([keypoints[LIMBS, :2], np.full(12, 0.8)])
