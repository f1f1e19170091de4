"""The matrix K of a pinhole camera with square pixels and its principal point in the middle of the picture, and the
picture of a lens that bends straight lines, made that of a pinhole camera."""

import math

import numpy as np
from jaxtyping import Float

from humanmm.models.records.camera import Intrinsics

DEFAULT_FOCAL_PER_DIAGONAL = math.sqrt(28.0 * 50.0) / math.hypot(36.0, 24.0)
"""Video is shot with anything between a phone's main camera (26 to 30 mm full-frame equivalent after the crop of its
stabiliser) and a normal lens (50 mm). Their geometric mean, 37 mm, over the 43.27 mm diagonal of a full frame is 0.865
of the picture's diagonal: 60 degrees across the diagonal; GVHMR and WHAM take 1.0."""


def K_from_focal(focal_px: float, width: float, height: float) -> Float[np.ndarray, "3 3"]:  # noqa: N802
    """(3,3) float64, pixels with centres at .5 (Hartley and Zisserman 2004, eq. 6.9, square pixels, no skew)."""
    return np.array([[focal_px, 0, width / 2], [0, focal_px, height / 2], [0, 0, 1.0]])


def K_of(intrinsics: Intrinsics) -> Float[np.ndarray, "3 3"]:  # noqa: N802
    """(3,3) float64 of the camera that all shots share."""
    return K_from_focal(intrinsics.focal_px, intrinsics.width, intrinsics.height)


def straightened(
    xy: Float[np.ndarray, "*n 2"], distortion: float, width: float, height: float
) -> Float[np.ndarray, "*n 2"]:
    """Where a pinhole camera would see what a lens with this radial distortion shows at these pixels.

    The division model (Fitzgibbon, CVPR 2001): a pixel at the fraction ρ of half the diagonal from the middle belongs
    1 / (1 + distortion · ρ²) times as far from it. Barrel distortion is negative; 0 is a pinhole camera.
    """
    if not distortion:
        return xy
    middle = np.array([width, height], xy.dtype) / 2
    off = xy - middle
    rho_squared = (off**2).sum(axis=-1, keepdims=True) / (middle @ middle)
    return np.asarray(middle + off / (1 + xy.dtype.type(distortion) * rho_squared))


def default_focal_px(width: float, height: float) -> float:
    """Focal length in pixels to assume of a picture of which nothing else is known."""
    return DEFAULT_FOCAL_PER_DIAGONAL * math.hypot(width, height)
