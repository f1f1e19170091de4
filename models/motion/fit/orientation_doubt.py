"""How likely a fitted body is turned the wrong way: what the lifter and the fit say of each other.

Two things foretell that a body's orientation is far off: the lifter says that it does not know it, and the fit, which
sees 2D keypoints and bones too, ends far from what the lifter says.
"""

import numpy as np
from jaxtyping import Float

from humanmm.models.geometry.rotations import rotation_distance
from humanmm.models.records.tracks import UNKNOWN_RAD

Array = np.ndarray

MISORIENTED_DEG = 45.0
"""A body whose orientation is off by more is turned the wrong way."""
USUAL = 0.06
"""Fraction of frames in which that is so: of a frame of which the lifter says nothing."""
INTERCEPT, OF_SIGMA, OF_GAP = -3.28, 0.94, 1.38
"""Logistic regression on the logarithms of the lifter's standard deviation over 10° and of the gap between lifter and
fit over 15° (rendered development clips)."""
MOST_SIGMA_DEG, LEAST_GAP_DEG = 90.0, 3.0
"""Beyond these nothing changes any more."""


def misoriented(
    R_fitted: Float[Array, "N 3 3"], R_lifted: Float[Array, "N 3 3"], sigma_rad: Float[Array, " N"]
) -> Float[Array, " N"]:
    """Probability that the fitted orientation is off by more than MISORIENTED_DEG, for each frame.

    Both rotations in the same axes; `sigma_rad`: the lifter's own expected error, UNKNOWN_RAD where it says nothing.
    """
    gap_deg = np.maximum(np.degrees(rotation_distance(R_fitted, R_lifted)), LEAST_GAP_DEG)
    sigma_deg = np.minimum(np.degrees(sigma_rad), MOST_SIGMA_DEG)
    logit = INTERCEPT + OF_SIGMA * np.log(sigma_deg / 10) + OF_GAP * np.log(gap_deg / 15)
    return np.where(sigma_rad < UNKNOWN_RAD, 1 / (1 + np.exp(-logit)), USUAL)
