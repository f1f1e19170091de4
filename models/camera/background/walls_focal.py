"""The focal length from straight edges: with the right one, walls, floors and edges stand at right angles.

Three directions at right angles have vanishing points that fix the focal length of a camera whose principal point is
known (Caprile and Torre, "Using vanishing points for camera calibration", IJCV 1990). Here it need not be known which
segment vanishes where: for every focal length of a grid the likeliest Manhattan frame is found.
"""

import numpy as np
from jaxtyping import Float

from humanmm.models.camera.background.manhattan import LEAST_SEGMENTS, log_posterior, settled, start_frames, support
from humanmm.models.camera.background.segments import Segments
from humanmm.models.geometry.intrinsics import K_from_focal

Array = np.ndarray

LOG_SCALES = np.arange(-8, 9) * 0.07
"""Focal lengths that are tried: logarithm of their ratio to the default."""
SEARCHED = (2, 8, 14)
"""Those at which frames are searched; the others begin with the frames of the nearest."""
STARTS = 4
PICTURE_KAPPA = 1 / np.radians(15.0) ** 2
"""Concentration of the vertical about the picture's own."""
TEMPER = 0.1
"""Segments are no independent witnesses (a tiled floor has hundreds that are wrong together): what each counts for."""
LEAST_SUPPORT = 0.3
"""Fraction of the segments along the second axis that chance must not explain."""
LARGEST = 4.0
"""No picture says more than exp(−4) against any focal length."""
UP_CAM = np.array([0.0, -1.0, 0.0])


def focal_log_likelihood(
    ends: Float[Array, "segments 4"], default_px: float, width: int, height: int
) -> Float[Array, " scales"] | None:
    """What one picture's segments (pixels) say of focal lengths default_px · exp(LOG_SCALES); 0 is the likeliest.

    None with too few segments, or where they run along one direction alone: those vanish at one point, which determines
    nothing of the focal length.
    """
    if len(ends) < LEAST_SEGMENTS:
        return None

    def seen_with(scale: float) -> Segments:
        return Segments.of([ends], [K_from_focal(default_px * float(np.exp(scale)), width, height)], [np.eye(3)])

    starts = {k: start_frames(seen_with(LOG_SCALES[k]), UP_CAM, PICTURE_KAPPA, count=STARTS) for k in SEARCHED}
    found = []
    for k, scale in enumerate(LOG_SCALES):
        seen = seen_with(scale)
        begin = starts[min(SEARCHED, key=lambda searched: abs(searched - k))]
        frames = settled(seen, begin, UP_CAM, PICTURE_KAPPA)
        posterior = log_posterior(seen, frames, UP_CAM, PICTURE_KAPPA)
        best = int(np.argmax(posterior))
        _, real = support(seen, seen.residuals(frames[best])[0])
        found.append((posterior[best], np.sort(real)[1]))
    value, second_axis = np.array(found).T
    if second_axis[int(value.argmax())] < LEAST_SUPPORT:
        return None
    return np.asarray(np.maximum(TEMPER * (value - value.max()), -LARGEST))
