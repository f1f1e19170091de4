"""Acceleration error and jitter: differences of joint positions over consecutive frames."""

import numpy as np
from jaxtyping import Bool, Float, Int

from humanmm.models.records.sequence import UndefinedFigureError


def acceleration_error_ms2(
    predicted: Float[np.ndarray, "frames joints 3"],
    truth: Float[np.ndarray, "frames joints 3"],
    *,
    frame: Int[np.ndarray, "frames"],
    fps: float,
) -> float:
    """ACCEL: mean length of the difference of second differences, m/s². Joints root-relative and in common axes."""
    steady = consecutive(frame, 2)
    difference = np.diff(predicted - truth, n=2, axis=0)[steady]
    return fps**2 * float(np.linalg.norm(difference, axis=-1).mean())


def jitter_10ms3(
    joints: Float[np.ndarray, "frames joints 3"], *, frame: Int[np.ndarray, "frames"], fps: float
) -> float:
    """Mean length of the third difference of world joints × fps³, in units of 10 m/s³."""
    steady = consecutive(frame, 3)
    return fps**3 / 10.0 * float(np.linalg.norm(np.diff(joints, n=3, axis=0)[steady], axis=-1).mean())


def consecutive(frame: Int[np.ndarray, "frames"], order: int) -> Bool[np.ndarray, "differences"]:
    """(N − order,) true where order + 1 frames follow one another without a hole. Raises if none do."""
    steady = frame[order:] - frame[:-order] == order
    if not steady.any():
        raise UndefinedFigureError(f"no {order + 1} consecutive frames are in both truth and prediction")
    return np.asarray(steady)
