"""Hands over time: looks at a hand, some a second, become numbers of every frame, and a hand at ease where unseen."""

import numpy as np
from jaxtyping import Float

Array = np.ndarray

KERNEL_S = 0.04
"""Standard deviation of the Gaussian by which looks are averaged: half the power passes at 3.3 Hz."""
HOLD_S, FADE_S = 0.1, 0.3
"""A hand stays as it was last seen, or will be seen next, for a moment, and is at ease after another one."""


def over_time(
    time_s: Float[Array, " N"],
    look_s: Float[Array, " L"],
    values: Float[Array, "L C"],
    confidence: Float[Array, " L"],
    at_ease: Float[Array, " C"],
) -> tuple[Float[Array, "N C"], Float[Array, " N"]]:
    """Values and confidence (0..1; 0 where the hand was not seen) at `time_s`, from looks at `look_s`, both increasing.

    A look of confidence nan was none. Where nobody saw the hand the values are those `at_ease`.
    """
    looked = ~np.isnan(confidence)
    at, weight, values = look_s[looked], confidence[looked], values[looked]
    found, certain = np.tile(at_ease, (len(time_s), 1)), np.zeros(len(time_s))
    reach = HOLD_S + FADE_S
    first, last = np.searchsorted(at, time_s - reach), np.searchsorted(at, time_s + reach)
    for row, (a, b) in enumerate(zip(first, last, strict=True)):
        apart = np.abs(at[a:b] - time_s[row])
        kernel = np.exp(-((apart / KERNEL_S) ** 2) / 2)
        seen = kernel * weight[a:b]
        if not seen.any():
            continue
        left = np.clip(1 - (apart[seen > 0].min() - HOLD_S) / FADE_S, 0, 1)
        share = left**2 * (3 - 2 * left)  # begins and ends without a jump of speed
        certain[row] = share * seen.sum() / kernel.sum()
        found[row] = share * (seen @ values[a:b]) / seen.sum() + (1 - share) * at_ease
    return found, certain
