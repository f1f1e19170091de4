"""One focal length for all shots (the paper's assumption): given, estimated from the background, or a prior.

The prior. Video is shot with anything between a phone's main camera (26 to 30 mm full-frame equivalent after the crop
of its stabiliser) and a normal lens (50 mm). Their geometric mean, 37 mm, over the 43.27 mm diagonal of a full frame
is 0.865 of the picture's diagonal (60 degrees across the diagonal; GVHMR and WHAM take 1.0). One sigma spans 25 to 55
mm.
"""

import math

from humanmm.models.camera.observations import Intrinsics

DEFAULT_FOCAL_PER_DIAGONAL = math.sqrt(28.0 * 50.0) / math.hypot(36.0, 24.0)
DEFAULT_RELATIVE_SIGMA = 0.4


def given_intrinsics(width: int, height: int, *, focal_px: float | None, fov_deg: float | None) -> Intrinsics | None:
    """The user's own focal length, in pixels or as a horizontal field of view in degrees; None if neither is given."""
    if focal_px is None and fov_deg is None:
        return None
    focal = focal_px if focal_px is not None else width / 2 / math.tan(math.radians(fov_deg or 0.0) / 2)
    return Intrinsics(focal, width, height, "given", 0.0)


def default_intrinsics(width: int, height: int) -> Intrinsics:
    """The prior alone."""
    return Intrinsics(
        DEFAULT_FOCAL_PER_DIAGONAL * math.hypot(width, height), width, height, "default", DEFAULT_RELATIVE_SIGMA
    )
