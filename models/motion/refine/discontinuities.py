"""Discontinuities at cuts: what two shots say of the same instant is made one.

Each shot's pose carries an error of its own (mostly bias: it lasts), so a person changes posture from one frame to the
next where the camera changes. Both sides are carried on to the middle of the cut, and each gives way by half of their
difference, fading out into its shot. Quick detail of the motion on both sides stays as it is.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int

from humanmm.models.geometry.lines import line_through
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.motion.refine.smoothing import fade

Array = np.ndarray

FADE_S = 0.4
"""How far into each shot the correction reaches."""

CARRY_S = 0.1
"""Length of the runs of frames from which each side is carried on to the cut."""

LONGEST_STEP_S = 0.2
"""Sides further apart in time than this have a gap between them, which is filled in instead,"""

LONGEST_STEP_FRAMES = 1.5
"""unless the whole video's frames are further apart: one interval between frames is no gap, two are."""


def close_discontinuities(
    vectors: Float[Array, "N J 3"],
    *,
    frame: Int[Array, " N"],
    observed: Bool[Array, " N"],
    time_s: Float[Array, " N"],
    cut_frames: Sequence[int],
) -> Float[Array, "N J 3"]:
    """The rotation vectors (radians) with the jump at every cut divided between both shots.

    `frame` and `cut_frames` increase. Cuts around a shot in which the person is not seen are one.
    """
    if not cut_frames or len(frame) < 2:
        return vectors
    closed = vectors.copy()
    longest_step_s = max(LONGEST_STEP_S, LONGEST_STEP_FRAMES * float(np.median(np.diff(time_s))))
    known = np.flatnonzero(observed)
    shots = [rows for rows in np.split(known, np.searchsorted(frame[known], cut_frames)) if len(rows)]
    for before, after in pairwise(shots):  # a shot in which nobody is seen has no side
        if time_s[after[0]] - time_s[before[-1]] > longest_step_s:
            continue
        middle = (time_s[before[-1]] + time_s[after[0]]) / 2
        end = _carried(vectors, before[::-1], time_s, middle)
        start = _carried(vectors, after, time_s, middle)
        jump = rotmat_to_rotvec(np.swapaxes(end, -1, -2) @ start)  # in the joint's own axes at the cut
        # A fade never reaches past the middle of a shot, so that two cuts' corrections do not meet.
        for rows, sign in ((before, 0.5), (after, -0.5)):
            reach = min(FADE_S, (time_s[rows[-1]] - time_s[rows[0]]) / 2 + 1e-9)
            away = np.abs(time_s[rows] - middle) / reach
            rows, fraction = rows[away < 1], fade(away[away < 1])
            correction = rotvec_to_rotmat(sign * fraction[:, None, None] * jump)
            closed[rows] = rotmat_to_rotvec(rotvec_to_rotmat(closed[rows]) @ correction)
    return closed


def _carried(vectors: Array, rows: Array, time_s: Array, when: float) -> Float[Array, "J 3 3"]:
    """Rotations at `when` by a straight line through the nearest frames (rows in order of distance from the cut)."""
    near = rows[np.abs(time_s[rows] - time_s[rows[0]]) <= CARRY_S]
    R = rotvec_to_rotmat(vectors[near])
    base = R[0]
    if len(near) < 3:
        return np.asarray(base)
    rotations = rotmat_to_rotvec(np.swapaxes(base, -1, -2) @ R)
    carried, _ = line_through(time_s[near] - when, rotations)
    return np.asarray(base @ rotvec_to_rotmat(carried))
