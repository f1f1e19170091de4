"""Where people are after a cut, seen from where they were before it: has the cut been joined?"""

import numpy as np

from humanmm.models.evaluation.pairs import Pair, pairs_of
from humanmm.models.geometry.alignment import umeyama_alignment
from humanmm.models.records.sequence import MotionSequence, UndefinedFigureError

WINDOW_S = 1.0
"""Before a cut the two sides are aligned over so long, after it they are compared over so long."""
LEAST_FRAMES = 3


def root_errors_after_cuts_m(prediction: MotionSequence, truth: MotionSequence) -> list[float | None]:
    """Root error just after each of the truth's cuts, metres, after a rigid alignment of the joints just before it.

    The worst over the people on both sides of the cut. None for a cut that nobody crosses in both sequences.
    """
    pairs = pairs_of(prediction, truth)
    window = max(LEAST_FRAMES, round(WINDOW_S * truth.fps))
    errors: list[float | None] = []
    for (start, cut), (_, end) in zip(truth.shots[:-1], truth.shots[1:], strict=True):
        found = [
            _error(pair, (max(start, cut - window), cut), (cut, min(end, cut + window)))
            for pair in pairs
            if cut not in truth.unlinked_cuts
        ]
        known = [error for error in found if error is not None]
        errors.append(max(known) if known else None)
    return errors


def anchor_mpjpe_mm(prediction: MotionSequence, truth: MotionSequence) -> float:
    """Mean joint error of the shots after the first, millimetres, after a rigid alignment over the first alone: how far
    the joints drift apart from cut to cut. The mean over the people who are in the first shot of both sequences.

    UndefinedFigureError where nobody is seen in the first shot and after it.
    """
    first = truth.shots[0][1]
    errors = []
    for pair in pairs_of(prediction, truth):
        inside = pair.frame < first
        if min(np.count_nonzero(inside), np.count_nonzero(~inside)) < LEAST_FRAMES:
            continue
        predicted, true = pair.joints_predicted, pair.joints_truth
        rigid = umeyama_alignment(
            predicted[inside].reshape(-1, 3), true[inside].reshape(-1, 3), with_scale=False, unique=False
        )
        moved = rigid.apply(predicted[~inside].reshape(-1, 3))
        errors.append(float(np.linalg.norm(moved - true[~inside].reshape(-1, 3), axis=-1).mean()))
    if not errors:
        raise UndefinedFigureError("nobody is seen in the first shot and after it")
    return 1000 * float(np.mean(errors))


def _error(pair: Pair, before: tuple[int, int], after: tuple[int, int]) -> float | None:
    rows = [np.flatnonzero((pair.frame >= a) & (pair.frame < b)) for a, b in (before, after)]
    if min(map(len, rows)) < LEAST_FRAMES:
        return None
    joints = [side[rows[0]].reshape(-1, 3) for side in (pair.joints_predicted, pair.joints_truth)]
    roots = [side[rows[1]] for side in pair.roots]
    moved = umeyama_alignment(joints[0], joints[1], with_scale=False, unique=False).apply(roots[0])
    return float(np.linalg.norm(moved - roots[1], axis=-1).mean())
