"""Feet that stand: how far they move while the truth says so, and whether the prediction says it too."""

import numpy as np
from jaxtyping import Bool, Float, Int

from humanmm.models.evaluation.people import match_sequences
from humanmm.models.evaluation.pose import METRES_TO_MM
from humanmm.models.evaluation.smoothness import consecutive
from humanmm.models.records.sequence import MotionSequence, UndefinedFigureError

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


def contact_f1(prediction: MotionSequence, truth: MotionSequence) -> float:
    """F1 of the contacts of ankles and toe bases, 0..1: over the frames in which a person is in both sequences and is
    observed in the prediction, all people together. Of a person who is not found at all, every contact in the frames in
    which the truth observes him is missed; people who are in the prediction alone count nowhere.

    UndefinedFigureError where the truth or the prediction has no contacts, or no foot stands in either.
    """
    match = match_sequences(prediction, truth)
    both = either = 0
    for index, true in enumerate(truth.people):
        if true.contacts is None:
            continue
        stands = true.contacts >= CONTACT_PROBABILITY
        if index not in match:
            either += int(stands[true.observed].sum())
            continue
        one = prediction.people[match[index]]
        if one.contacts is None:
            continue
        _, i, j = np.intersect1d(one.frame[one.observed], true.frame, assume_unique=True, return_indices=True)
        said = one.contacts[one.observed][i] >= CONTACT_PROBABILITY
        both += int((said & stands[j]).sum())
        either += int(said.sum() + stands[j].sum())
    if not either or all(person.contacts is None for person in prediction.people):
        raise UndefinedFigureError("no contacts are known")
    return 2 * both / either
