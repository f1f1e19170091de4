"""Looks whose shifts stand in what the layers show, for tests of trainings."""

import numpy as np

Array = np.ndarray


def look_arrays(shots: int = 4, looks: int = 8) -> dict[str, Array]:
    """As a set holds them: a landmark's shift is what the two first channels of its window's middle say, in cells."""
    rng = np.random.default_rng(0)
    windows = rng.normal(0, 1, (shots, looks, 22, 7, 7, 74))
    return {
        "windows": windows.astype(np.float16),
        "coarse": rng.normal(0, 1, (shots, looks, 22, 96)).astype(np.float16),
        "numbers": rng.normal(0, 1, (shots, looks, 22, 13)).astype(np.float16),
        "shift": (4 * windows[:, :, :, 3, 3, :2]).astype(np.float16),
        "is_known": rng.random((shots, looks, 22)) < 0.9,
    }
