"""Long gaps: whoever leaves in the air, or comes back so, stands meanwhile.

A gap is crossed on the straight path between the poses at its ends (`smoothing`). Of somebody who was last seen in the
middle of a somersault that is a body that hangs in the air, head down, for as long as nobody sees him. So in a long gap
he comes down to how he last stood, and comes back from how he will stand first.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from humanmm.models.geometry.intervals import runs_of_true
from humanmm.models.motion.refine.contacts import STANDS

LONG_S = 2.0
LANDED_S, HELD_S = 0.8, 0.2
"""So long after he was seen he stands, and for so long that counts as evidence; between both ends the path is straight
again."""
TRUST = 0.3
"""Weight of that evidence: frames in which somebody is seen have up to 1."""


@dataclass(frozen=True)
class Landing:
    """Rows of a gap in which somebody stands as in the row `like`, at the place of the row `edge`."""

    rows: Int[np.ndarray, " n"]
    like: int
    edge: int


def landings(
    observed: Bool[np.ndarray, " N"], contacts: Float[np.ndarray, "N 4"], time_s: Float[np.ndarray, " N"]
) -> list[Landing]:
    """Where somebody who is not seen for long stands; nowhere where a foot of his stands at the gap's end already."""
    stands = observed & (contacts.max(axis=1) >= STANDS)
    standing, found = np.flatnonzero(stands), []
    for start, end in runs_of_true(~observed):
        if start == 0 or end == len(observed) or time_s[end] - time_s[start - 1] <= LONG_S:
            continue
        since, until = time_s - time_s[start - 1], time_s[end] - time_s
        for edge, away_s, own in (
            (start - 1, since, standing[standing < start][::-1]),
            (end, until, standing[standing >= end]),
        ):
            if not stands[edge] and len(own):
                rows = np.arange(start, end)
                here = (away_s[rows] >= LANDED_S) & (away_s[rows] <= LANDED_S + HELD_S)
                found.append(Landing(rows[here], int(own[0]), edge))
    return found


def landed(
    vectors: Float[np.ndarray, "N J 3"],
    pelvis: Float[np.ndarray, "N 3"],
    weight: Float[np.ndarray, " N"],
    found: list[Landing],
) -> tuple[Float[np.ndarray, "N J 3"], Float[np.ndarray, "N 3"], Float[np.ndarray, " N"]]:
    """Poses, places and their weights with those of the landings."""
    vectors, pelvis, weight = vectors.copy(), pelvis.copy(), weight.copy()
    for one in found:
        vectors[one.rows] = vectors[one.like]
        pelvis[one.rows] = [*pelvis[one.edge, :2], pelvis[one.like, 2]]
        weight[one.rows] = TRUST
    return vectors, pelvis, weight
