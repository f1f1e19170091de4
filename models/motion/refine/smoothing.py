"""Smoothing over real time with a sharp, zero-phase band limit, and filling of gaps, in one banded linear solve.

Minimises Σ w_t Δt_t |x_t − y_t|² + λ₃ ∫ |x‴|² dt + λ₁ ∫_gaps |x′|² dt. With λ₃ = (2π f)⁻⁶ the first two terms are a
low-pass filter of response 1 / (1 + (ω/2πf)⁶) whatever the frame rate; where there is no evidence (w = 0) they carry
the motion on with least jerk, and the third draws it towards the straight path within a quarter of a second, so that a
long gap is crossed without a swing.
"""

import math

import numpy as np
from jaxtyping import Bool, Float
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.spatial.transform import Rotation

from humanmm.models.motion.fit.equations import REFERENCE_HZ, frame_weights

Array = np.ndarray

ORDER = 3
"""The derivative that is kept small: jerk."""

CARRY_ON_S = 0.25
"""How long a motion keeps its velocity in a gap."""


class Smoother:
    """The filter of N samples with these weights: its matrix is factorised once, for however many values."""

    def __init__(self, weight: Float[Array, " N"], time_s: Float[Array, " N"], *, cutoff_hz: float) -> None:
        self._known = weight > 0
        self._data = weight * frame_weights(time_s)
        upper = _roughness(time_s, self._known, cutoff_hz)
        upper[0] += self._data + 1e-12 * self._data.max()
        bands, n = upper.shape
        packed = np.zeros_like(upper)
        for k in range(bands):  # scipy keeps (i, j) at [bands − 1 + i − j, j]
            packed[bands - 1 - k, k:] = upper[k, : max(n - k, 0)]
        self._factor = cholesky_banded(packed) if self._known.any() else packed

    def __call__(self, values: Float[Array, "N C"]) -> Float[Array, "N C"]:
        """The smooth path nearest to the values; frames of weight 0 are filled in. No weight: the values themselves."""
        if not self._known.any():
            return values.copy()
        right = self._data[:, None] * np.where(self._known[:, None], values, 0.0)
        return np.asarray(cho_solve_banded((self._factor, False), right))


def _roughness(time_s: Float[Array, " N"], known: Bool[Array, " N"], cutoff_hz: float) -> Float[Array, "4 N"]:
    """The quadratic form of jerk (and speed in gaps) whose weight makes it a low-pass filter of this cut-off for
    evidence of weight 1 per 1/30 s: diagonals[k, i] stands at (i, i + k)."""
    step = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 1 / REFERENCE_HZ
    # A difference quotient is smaller than the derivative: this is its gain at the cut-off.
    gain = 2 / step * np.sin(np.pi * min(cutoff_hz * step, 0.5))
    strength = gain ** (-2 * ORDER) * REFERENCE_HZ
    rough = _accumulate(time_s, ORDER, np.full(max(len(time_s) - ORDER, 0), strength))
    in_gap = ~(known[1:] & known[:-1])
    return np.asarray(rough + _accumulate(time_s, 1, np.where(in_gap, strength / CARRY_ON_S ** (2 * (ORDER - 1)), 0.0)))


def _accumulate(time_s: Float[Array, " N"], order: int, strength: Float[Array, " M"]) -> Float[Array, "4 N"]:
    """Σ strength · span · |divided difference|² of one order, as upper diagonals."""
    n = len(time_s)
    diagonals = np.zeros((ORDER + 1, n))
    if n <= order:
        return diagonals
    windows = np.lib.stride_tricks.sliding_window_view(time_s, order + 1)
    gaps = windows[:, :, None] - windows[:, None, :] + np.eye(order + 1)
    stencil = math.factorial(order) / np.prod(gaps, axis=-1)  # a derivative as divided difference, for uneven steps too
    span = (time_s[order:] - time_s[:-order]) / order
    for a in range(order + 1):
        for b in range(a, order + 1):
            diagonals[b - a, a : a + n - order] += strength * span * stencil[:, a] * stencil[:, b]
    return diagonals


def fade(x: Float[Array, "*batch"]) -> Float[Array, "*batch"]:
    """1 up to 0, 0 from 1 on, with no kink at either end: 1 less the smootherstep of Perlin 2002, "Improving noise"."""
    x = np.clip(x, 0.0, 1.0)
    return np.asarray(1 - x * x * x * (10 - 15 * x + 6 * x * x))


def smooth(
    values: Float[Array, "N C"], weight: Float[Array, " N"], time_s: Float[Array, " N"], *, cutoff_hz: float
) -> Float[Array, "N C"]:
    """The values through the `Smoother` of these weights."""
    return Smoother(weight, time_s, cutoff_hz=cutoff_hz)(values)


def smooth_rotations(
    vectors: Float[Array, "N J 3"], weight: Float[Array, " N"], time_s: Float[Array, " N"], *, cutoff_hz: float
) -> Float[Array, "N J 3"]:
    """The same for rotation vectors (radians), through unit quaternions of continuous sign.

    Within the reach of the filter (a tenth of a second) a joint rotates little, so that smoothing the four numbers and
    putting them back to length 1 is smoothing on the sphere; across a gap it is the spherical path, to first order.
    """
    smoothed, smoother = np.empty_like(vectors), Smoother(weight, time_s, cutoff_hz=cutoff_hz)
    known = np.flatnonzero(weight > 0)
    for joint in range(vectors.shape[1]):  # one at a time: the numbers between are many times as large as the result
        quaternions = Rotation.from_rotvec(vectors[:, joint]).as_quat(scalar_first=True)
        along = quaternions[known]
        flips = np.where(np.sum(along[1:] * along[:-1], axis=-1) < 0, -1.0, 1.0)
        along[1:] *= np.cumprod(flips)[:, None]
        quaternions[known] = along
        smoothed[:, joint] = Rotation.from_quat(smoother(quaternions), scalar_first=True).as_rotvec()
    return smoothed
