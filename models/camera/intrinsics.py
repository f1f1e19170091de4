"""One focal length for all shots (the paper's assumption): given, estimated from the background, or a prior.

The prior. Video is shot with anything between a phone's main camera (26 to 30 mm full-frame equivalent after the crop
of its stabiliser) and a normal lens (50 mm). Their geometric mean, 37 mm, over the 43.27 mm diagonal of a full frame
is 0.865 of the picture's diagonal (60 degrees across the diagonal; GVHMR and WHAM take 1.0). One sigma spans 25 to 55
mm.

The evidence. Every shot whose camera turns or moves tells its focal length with an uncertainty (`selfcalibration`).
Prior and evidence are multiplied on a grid of ln(focal); evidence has heavy tails, so that a shot with a lens of its
own, or one that was misread, does not drag the rest away.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from humanmm.models.camera.masking import background_points
from humanmm.models.camera.odometry.tracked_shot import arrange
from humanmm.models.camera.self_calibration import FocalEvidence, focal_evidence
from humanmm.models.records.camera import Intrinsics, PointTracks
from humanmm.models.records.tracks import PersonTrack

DEFAULT_FOCAL_PER_DIAGONAL = math.sqrt(28.0 * 50.0) / math.hypot(36.0, 24.0)
DEFAULT_RELATIVE_SIGMA = 0.4
MODEL_RELATIVE_SIGMA = 0.03
"""What a pinhole with its principal point in the middle is worth on a real lens; no estimate claims to be better."""
TAIL_DEGREES = 3.0
"""Degrees of freedom of Student's t for the evidence of a shot."""
MAX_FRAMES = 600
"""Recorded frames of a shot that are looked at."""
MAX_SHOTS = 4
"""Shots that are asked, those with most points over most frames first."""
ENOUGH_RELATIVE_SIGMA = 0.02
"""Once this sure, no further shot is asked."""
NARROWED = 0.5
"""The result is called estimated if its sigma is below this share of the prior's."""


@dataclass(frozen=True)
class ShotPoints:
    """One shot's tracked points and the people to be left out of them."""

    points: PointTracks
    people: Sequence[PersonTrack]


def given_intrinsics(width: int, height: int, *, focal_px: float | None, fov_deg: float | None) -> Intrinsics | None:
    """The user's own focal length, in pixels or as a horizontal field of view in degrees; None if neither is given."""
    if focal_px is None and fov_deg is None:
        return None
    focal = focal_px if focal_px is not None else width / 2 / math.tan(math.radians(fov_deg or 0.0) / 2)
    return Intrinsics(focal, width, height, "given", 0.0)


def default_focal_px(width: int, height: int) -> float:
    """Centre of the prior, pixels."""
    return DEFAULT_FOCAL_PER_DIAGONAL * math.hypot(width, height)


def estimate_intrinsics(shots: Sequence[ShotPoints], width: int, height: int) -> Intrinsics:
    """The focal length that prior and background agree on; source "default" where the background hardly tells."""
    default = default_focal_px(width, height)
    evidence: list[FocalEvidence] = []
    result = combine(evidence, default, width, height)
    for shot in sorted(shots, key=lambda shot: -len(shot.points.frame))[:MAX_SHOTS]:
        background = arrange(background_points(_beginning(shot.points), shot.people), width, height)
        found = focal_evidence(background, result.focal_px)
        if found is not None:
            evidence.append(found)
            result = combine(evidence, default, width, height)
        if result.relative_uncertainty < ENOUGH_RELATIVE_SIGMA:
            break
    return result


def _beginning(points: PointTracks) -> PointTracks:
    """The first recorded frames of a long shot."""
    frames = np.unique(points.frame)
    if len(frames) <= MAX_FRAMES:
        return points
    last = int(np.searchsorted(points.frame, frames[MAX_FRAMES]))
    return replace(
        points, track=points.track[:last], frame=points.frame[:last], xy=points.xy[:last],
        confidence=points.confidence[:last],
    )  # fmt: skip


def combine(evidence: Sequence[FocalEvidence], default_px: float, width: int, height: int) -> Intrinsics:
    """Mean and spread of prior times evidence over ln(focal)."""
    log_focal = math.log(default_px) + np.linspace(-2.0, 2.0, 8001)
    log_density = -0.5 * ((log_focal - math.log(default_px)) / DEFAULT_RELATIVE_SIGMA) ** 2
    for one in evidence:
        log_density = log_density + _log_likelihood(log_focal, one)
    density = np.exp(log_density - log_density.max())
    density /= density.sum()
    mean = float((density * log_focal).sum())
    sigma = float(np.sqrt((density * (log_focal - mean) ** 2).sum()))
    narrowed = sigma < NARROWED * DEFAULT_RELATIVE_SIGMA
    if not narrowed:
        return Intrinsics(default_px, width, height, "default", DEFAULT_RELATIVE_SIGMA)
    return Intrinsics(math.exp(mean), width, height, "estimated", sigma)


def _log_likelihood(log_focal: Float[np.ndarray, " n"], evidence: FocalEvidence) -> Float[np.ndarray, " n"]:
    sigma = math.hypot(evidence.log_sigma, MODEL_RELATIVE_SIGMA)
    scaled = (log_focal - math.log(evidence.focal_px)) / sigma
    return np.asarray(-0.5 * (TAIL_DEGREES + 1) * np.log1p(scaled**2 / TAIL_DEGREES))
