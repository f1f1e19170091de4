"""Foot sliding: how far feet move while the truth says that they stand."""

import numpy as np
from jaxtyping import Bool, Float, Int

from humanmm.models.evaluation.pose import METRES_TO_MM
from humanmm.models.evaluation.smoothness import consecutive
from humanmm.models.records.sequence import UndefinedFigureError

CONTACT_PROBABILITY = 0.5
STANDING_SPEED_MS = 0.3
"""A foot joint slower than this stands, where the truth has no contacts of its own."""


def standing_steps(
    contacts: Float[np.ndarray, "frames feet"], frame: Int[np.ndarray, "frames"]
) -> Bool[np.ndarray, "steps feet"]:
    """(N−1,C) true where a foot joint is in contact in both frames of a step between consecutive frames."""
    holds = contacts >= CONTACT_PROBABILITY
    return np.asarray(holds[1:] & holds[:-1] & consecutive(frame, 1)[:, None])


def slow_steps(
    feet: Float[np.ndarray, "frames feet 3"], frame: Int[np.ndarray, "frames"], *, fps: float
) -> Bool[np.ndarray, "steps feet"]:
    """(N−1,C) true where a foot joint moves at less than 0.3 m/s between consecutive frames."""
    speed = fps * np.linalg.norm(np.diff(feet, axis=0), axis=-1)
    return np.asarray((speed < STANDING_SPEED_MS) & consecutive(frame, 1)[:, None])


def foot_sliding_mm(feet: Float[np.ndarray, "frames feet 3"], standing: Bool[np.ndarray, "steps feet"]) -> float:
    """Mean path per frame of the standing foot joints, mm."""
    if not standing.any():
        raise UndefinedFigureError("the truth has no foot standing in two consecutive common frames")
    return METRES_TO_MM * float(np.linalg.norm(np.diff(feet, axis=0), axis=-1)[standing].mean())
