"""Something that toy stages compute with, so that a test can change it."""

import numpy as np


def factor() -> float:
    """A number that shows in results."""
    # a comment
    return 1.0


def ramp(start: int, end: int) -> np.ndarray:
    """(F,) float64, frame numbers times the factor."""
    return np.arange(start, end, dtype=np.float64) * factor()
