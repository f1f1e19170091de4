"""What a shot's points say of its focal length, and what several pieces of evidence say together."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from humanmm.models.camera.model_choice import HINT_FRACTION, ModelChoice
from humanmm.models.camera.odometry.keyframe_odometry import EXACT_FRACTION
from humanmm.models.camera.odometry.tracked_shot import TrackedShot
from humanmm.models.camera.self_calibration import FocalTrack
from humanmm.models.records.camera import EdgeEvidence

DEFAULT_RELATIVE_SIGMA = 0.4
MODEL_RELATIVE_SIGMA = 0.02
"""What a pinhole with its principal point in the middle is worth on a real lens; no estimate claims to be better."""
UNTOLD, MOST_UNTOLD = 4.0, 0.04
"""What a shot's points do not tell of their own error (tracks that creep, rolling shutter, a path that is nearly
straight) grows with what they tell, UNTOLD times as fast, up to so much. Of 67 shots of development clips those that
claim less than 0.01, 0.01 to 0.03 and 0.03 to 0.1 are off by 0.004, 0.037 and 0.032 in the median and by less than
0.011, 0.086 and 0.067 in four of five (`log_sigma`)."""
TAIL_DEGREES = 3.0
"""Degrees of freedom of Student's t for the evidence of a shot."""
LOG_RATIOS = np.linspace(-2.0, 2.0, 8001)
"""Focal lengths that are weighed: logarithm of their ratio to the default."""
LOG_PRIOR = -0.5 * (LOG_RATIOS / DEFAULT_RELATIVE_SIGMA) ** 2


@dataclass(frozen=True)
class FocalEvidence:
    """What one shot says about the focal length."""

    focal_px: float
    log_sigma: float
    """Standard deviation of ln(focal)."""

    def log_likelihood(self, log_focal: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Up to a constant, at ln(focal)."""
        sigma = math.hypot(self.log_sigma, MODEL_RELATIVE_SIGMA, min(UNTOLD * self.log_sigma, MOST_UNTOLD))
        scaled = (log_focal - math.log(self.focal_px)) / sigma
        return np.asarray(-0.5 * (TAIL_DEGREES + 1) * np.log1p(scaled**2 / TAIL_DEGREES))

    def enlarged(self, factor: float) -> "FocalEvidence":
        """The same of a lens that is `factor` times as long."""
        return replace(self, focal_px=factor * self.focal_px)


Evidence = FocalEvidence | EdgeEvidence


def focal_evidence(shot: TrackedShot, choice: ModelChoice) -> FocalEvidence | None:
    """Focal length of a shot from its model; None where the camera is static or fits badly.

    Of a shot that zooms the answer is the middle of its range, as uncertain as the zoom is large; if it moves as well,
    that of a camera which only rotates and zooms. What fits roughly counts as less certain: a rotation in proportion, a
    path by the square, whose points may be rigid with a wrong focal length as well.
    """
    if choice.rotating is None:
        return None
    if choice.model == "moving" and choice.moving is not None and math.isfinite(choice.moving.log_focal_sigma):
        return _evidence(choice.moving, _misfit(shot, choice.moving) ** 2)
    if choice.zooming is not None and math.isfinite(choice.zooming.log_focal_sigma):
        return _evidence(choice.zooming)
    misfit = _misfit(shot, choice.rotating)
    return _evidence(choice.rotating, misfit) if misfit < HINT_FRACTION / EXACT_FRACTION else None


def _misfit(shot: TrackedShot, calibrated: FocalTrack) -> float:
    """How many times as far as it should a track's points lie from where it puts them; 1 where it fits."""
    return max(1.0, calibrated.track.adjusted.noise_px / (EXACT_FRACTION * shot.diagonal_px))


def _evidence(calibrated: FocalTrack, factor: float = 1.0) -> FocalEvidence:
    """The middle of a track's focal lengths, `factor` times as uncertain as its points say."""
    views = calibrated.track.views
    middle_px = views.focal_px * float(np.exp(views.log_zoom.mean()))
    return FocalEvidence(middle_px, factor * float(np.hypot(calibrated.log_focal_sigma, np.ptp(views.log_zoom))))


def log_likelihood(evidence: Iterable[Evidence], default_px: float) -> Float[np.ndarray, " ratios"]:
    """Of all evidence together, at LOG_RATIOS to the default."""
    log_focal = math.log(default_px) + LOG_RATIOS
    return np.asarray(sum((one.log_likelihood(log_focal) for one in evidence), np.zeros(len(LOG_RATIOS))))


@dataclass(frozen=True, eq=False)
class Weighed:
    """Prior times evidence over LOG_RATIOS."""

    log_likelihood: Float[np.ndarray, " ratios"]

    @property
    def log_density(self) -> Float[np.ndarray, " ratios"]:
        """Not normalised."""
        return np.asarray(LOG_PRIOR + self.log_likelihood)

    @property
    def log_evidence(self) -> float:
        """Logarithm of the probability of the evidence, up to a constant of each of its pieces."""
        return float(np.logaddexp.reduce(self.log_density) - np.logaddexp.reduce(LOG_PRIOR))

    @property
    def log_ratio(self) -> tuple[float, float]:
        """Mean and standard deviation."""
        density = np.exp(self.log_density - self.log_density.max())
        density /= density.sum()
        mean = float((density * LOG_RATIOS).sum())
        return mean, float(np.sqrt((density * (LOG_RATIOS - mean) ** 2).sum()))
