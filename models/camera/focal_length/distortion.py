"""How the lens bends straight lines (radial distortion), by the points of shots whose cameras turn or travel.

Barrel distortion shows things near the border smaller than a pinhole camera does. A camera that turns then seems to
have a longer lens: 2 % at the corners make its focal length a tenth too long. Both are found together: a Newton step
of the distortion and of the focal length, everything else eliminated (`lens_step`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from humanmm.models.camera.model_choice import MOVING, ROTATING, ZOOMING, ModelChoice
from humanmm.models.camera.odometry.bundle import lens_step
from humanmm.models.camera.odometry.tracked_shot import TrackedShot
from humanmm.models.camera.self_calibration import correlation

UNTOLD, LEAST_STD = 3.0, 0.004
"""What points say of their own error is so many times too little, and never below LEAST_STD. Of 37 shots of development
clips without distortion half are off by more than 2.1 of the deviations that their points state, one of ten by more
than 5.5, nearly all of them upwards."""
CLEAR = 2.3
"""Barrel distortion is believed from so many standard deviations on; the opposite, which lenses of video seldom have,
never."""
USUAL_STD = 0.01
"""Standard deviation of the distortion of a lens that shows none: 1 % at the corners of the picture."""
LEAST, MOST = -0.01, -0.35
"""Distortions between which a lens is called a barrel: less does not matter, and a fisheye follows another law."""


@dataclass(frozen=True)
class DistortionEvidence:
    """What one shot says of the distortion that is left in its points."""

    left: float
    std: float
    log_focal_slope: float
    """Change of ln(focal) that goes with a change of the distortion."""

    def log_focal_std(self, distortion_std: float) -> float:
        """What is left open of ln(focal) if the distortion is known so well by all evidence."""
        return abs(self.log_focal_slope) / math.hypot(1 / USUAL_STD, 1 / distortion_std)


def distortion_evidence(shot: TrackedShot, choice: ModelChoice) -> DistortionEvidence | None:
    """Of a shot from its model; None where the camera is static or its points do not give its focal length."""
    calibrated, freedom = {
        "moving": (choice.moving, MOVING),
        "rotation and zoom": (choice.zooming, ZOOMING),
    }.get(choice.model, (choice.rotating, ROTATING))
    if calibrated is None or not math.isfinite(calibrated.log_focal_sigma):
        return None
    track = calibrated.track
    xy = track.observations.xy
    # Of x_d = x (1 + distortion ρ²), what a lens shows of a direction that it is not bent at yet.
    bent = xy * ((xy**2).sum(axis=1, keepdims=True) / (0.5 * shot.diagonal_px) ** 2)
    step, covariance = lens_step(
        track.adjusted, track.observations, fixed=track.held, freedom=freedom, beside=bent[..., None]
    )
    std = math.hypot(UNTOLD * math.sqrt(covariance[1, 1]) * correlation(track.observations), LEAST_STD)
    return DistortionEvidence(float(step[1]), std, float(covariance[0, 1] / covariance[1, 1]))


def together(evidence: Sequence[DistortionEvidence]) -> tuple[float, float]:
    """The distortion that is left by all evidence, and its standard deviation; infinite without any."""
    precision = sum(one.std**-2 for one in evidence)
    if not precision:
        return 0.0, math.inf
    return sum(one.left / one.std**2 for one in evidence) / precision, precision**-0.5
