"""Straight lines through values over time, by least squares."""

import numpy as np
from jaxtyping import Float

Array = np.ndarray


def line_through(
    x: Float[Array, " n"], values: Float[Array, "n *shape"]
) -> tuple[Float[Array, "*shape"], Float[Array, "*shape"]]:
    """The value of the line at x = 0, and its slope. Of fewer than two different `x` it is the one of least norm."""
    rows = np.stack([np.ones(len(x)), x], axis=1)
    at_zero, slope = np.linalg.lstsq(rows, values.reshape(len(x), -1), rcond=None)[0]
    return at_zero.reshape(values.shape[1:]), slope.reshape(values.shape[1:])
