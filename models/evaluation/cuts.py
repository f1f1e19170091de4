"""Precision, recall and F1 of the changes of shot, matched one to one with the truth's."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import maximum_bipartite_matching

HARD_CUT_TOLERANCE_FRAMES = 2
GRADUAL_TOLERANCE_FRAMES = 3
"""A gradual transition over [start, end) may be reported anywhere in [start − 3, end + 3]."""


@dataclass(frozen=True)
class CutScores:
    """Fractions 0..1. Nothing to find and nothing found is perfect."""

    precision: float
    recall: float

    @property
    def f1(self) -> float:
        total = self.precision + self.recall
        return 2.0 * self.precision * self.recall / total if total > 0 else 0.0


def score_cuts(predicted: Sequence[int], truth: Sequence[tuple[int, int]]) -> CutScores:
    """Scores of predicted cut frames against the truth's transitions [start, end), start == end for a hard cut."""
    if not predicted and not truth:
        return CutScores(1.0, 1.0)
    if not predicted or not truth:
        return CutScores(0.0, 0.0)
    matched = len(match_cuts(predicted, truth))
    return CutScores(precision=matched / len(predicted), recall=matched / len(truth))


def match_cuts(predicted: Sequence[int], truth: Sequence[tuple[int, int]]) -> dict[int, int]:
    """Index of the truth's transition for each index of a predicted cut frame that found one: one to one, as many pairs
    as possible."""
    if not predicted or not truth:
        return {}
    allowed = np.array([[_explains(frame, *transition) for transition in truth] for frame in predicted])
    found = maximum_bipartite_matching(csr_array(allowed), perm_type="column")
    return {index: int(transition) for index, transition in enumerate(found) if transition >= 0}


def _explains(frame: int, start: int, end: int) -> bool:
    if start == end:
        return abs(frame - start) <= HARD_CUT_TOLERANCE_FRAMES
    return start - GRADUAL_TOLERANCE_FRAMES <= frame <= end + GRADUAL_TOLERANCE_FRAMES
