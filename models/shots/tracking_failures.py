"""Tracking failures: a few frames whose pose fits neither the frames before nor those after them.

Seen from the side or while it rotates, a body may get a pose made of both sides' limbs for a few frames, with full
visibility. Swapping left and right does not mend it. A jump at either end that no choice of sides explains shows it,
while the frames before and after it fit one another. On rendered clips such frames have a pose error
of 130 to 260 mm, all others about 85 mm (measured against the truth of four clips; docs/method.md).
"""

import numpy as np
from jaxtyping import Bool, Float, Int

from humanmm.models.shots.left_right_swaps import SidesSeen, step_energies

Array = np.ndarray

JUMP = 25.0
"""Energy of two neighbouring frames, sides as they fit best, above which the body cannot have moved like that."""
AGREEMENT = 8.0
"""The most that the frames before and after a failure differ, as the energy of a pair that far apart. A frame between
them that differs no more from both is no part of the failure."""
LONGEST_S = 0.4
AT_END_S = 0.12
"""A failure at the beginning or end of a shot, where only one side can be compared, is at most so long."""
MAX_STEP_S = 0.2


def failed_frames(sighting: SidesSeen) -> Bool[Array, " n"]:
    """The frames of one person in one shot whose pose is not to be trusted."""
    n, time_s = len(sighting.frame), sighting.time_s
    lost = np.zeros(n, dtype=bool)
    if n < 3:
        return lost
    at = np.flatnonzero((step_energies(sighting).min(axis=1) > JUMP) & (np.diff(time_s) <= MAX_STEP_S))
    explained, done = np.zeros(n, dtype=bool), -1
    for first in at.tolist():
        if first <= done:
            continue
        later = at[(at > first) & (time_s[at + 1] - time_s[first] <= LONGEST_S + 1e-9)]
        last = next((k for k in later[::-1].tolist() if _agree(sighting, first, k + 1)), None)
        if last is not None:
            for row in range(first + 1, last + 1):
                lost[row] = not (_agree(sighting, first, row) and _agree(sighting, row, last + 1))
            explained[first : last + 1] = True
            done = last
    free = at[~explained[at]]
    lost[: _at_end(time_s, free)] = True
    lost[n - _at_end(-time_s[::-1], n - 2 - free[::-1]) :] = True
    return lost


def _agree(sighting: SidesSeen, row: int, other: int) -> bool:
    return bool(step_energies(sighting.only(np.array([row, other]))).min() < AGREEMENT)


def _at_end(time_s: Float[Array, " n"], jumps: Int[Array, " j"]) -> int:
    """Number of frames before the only jump in the first LONGEST_S, if it comes early; else 0."""
    early = jumps[time_s[jumps] - time_s[0] <= LONGEST_S]
    if len(early) != 1 or time_s[early[0]] - time_s[0] > AT_END_S or time_s[-1] - time_s[0] < 2 * LONGEST_S:
        return 0
    return int(early[0]) + 1
