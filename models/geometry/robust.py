"""Robust kernels of iteratively reweighted least squares, and robust standard deviations.

Kernels take residuals in units of their scale, so that a caller's scale is said once, at the call.
"""

import numpy as np
from jaxtyping import Float

Array = np.ndarray

MEDIAN_OF_RAYLEIGH = 1.1774
"""Median length of two-dimensional normal errors of standard deviation 1 an axis: √(2 ln 2)."""

STD_PER_MEDIAN = 1.4826
"""Standard deviation of a normal variable over its median absolute value (Rousseeuw and Croux 1993)."""


def cauchy_loss(squared: Float[Array, "*batch"]) -> Float[Array, "*batch"]:
    """log(1 + u²) of squared residuals u² in units of the scale: times half the scale's square, what replaces r² / 2.

    Black and Rangarajan 1996, "On the unification of line processes, outlier rejection, and robust statistics", the
    Lorentzian.
    """
    return np.asarray(np.log1p(squared))


def cauchy_weight(squared: Float[Array, "*batch"]) -> Float[Array, "*batch"]:
    """1 / (1 + u²): weight of a squared residual in units of the scale (Holland and Welsch 1977)."""
    return 1.0 / (1.0 + squared)


def huber_loss(size: Float[Array, "*batch"], limit: float) -> Float[Array, "*batch"]:
    """What replaces r²: r² up to `limit`, from there on 2 · limit · r − limit² (Huber 1964, doubled)."""
    return np.where(size <= limit, size**2, 2 * limit * size - limit**2)


def huber_weight(size: Float[Array, "*batch"], limit: float) -> Float[Array, "*batch"]:
    """min(1, limit / r): weight of a residual's square by its size (Holland and Welsch 1977)."""
    return np.asarray(np.minimum(1.0, limit / np.maximum(size, 1e-12)))


def std_of_lengths(length: Float[Array, " m"]) -> float:
    """Robust standard deviation an axis of two-dimensional errors from their lengths; nan without any."""
    return float(np.median(length)) / MEDIAN_OF_RAYLEIGH if len(length) else float("nan")
