"""Toes that stay on the floor while the heel rises: a foot that rolls over its ball would push them through it.

No pose network says how toes are bent, so the floor does.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.ndimage import uniform_filter1d

from humanmm.models.body.body24 import Body
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.motion.fit.state import LongMotion
from humanmm.models.motion.refine.footlock import LEGS, Leg

Array = np.ndarray

MOST_RAD = 1.0
"""Toes bend no further up than this."""
STEADY_S = 0.1
"""How far they are bent is averaged twice over this time, so that they do not snap when the foot leaves the floor."""
SOLE_M = 0.04
"""Skin this near to the ground of the rest pose is the foot's."""


def toe_length(body: Body, betas: Float[Array, " 10"]) -> float:
    """How far toes reach beyond the toe base in a shape, metres."""
    skin, toe_base = body.rest_vertices(betas), body.rest_joints(betas)[LEGS[0][-1]]
    foot = skin[skin[:, 1] < skin[:, 1].min() + SOLE_M]
    return float(foot[:, 2].max() - toe_base[2])


def bent_toes(
    motion: LongMotion, sole_height: Float[Array, " 4"], length_m: float, time_s: Float[Array, " N"]
) -> LongMotion:
    """The motion, its toes bent upwards so far that they are not below the floor, z = 0; nothing else moves.

    `sole_height`: of left ankle, left toe base, right ankle, right toe base above the ground where the foot is flat.
    """
    vectors = motion.vectors.copy()
    for side, (*_, toe) in enumerate(LEGS):
        leg = Leg.of(motion, side, slice(None))
        R_local = rotvec_to_rotmat(vectors[:, toe].astype(np.float64))
        ahead = (leg.R_ankle @ R_local)[..., 2]
        height = leg.toe[:, 2] - sole_height[2 * side + 1]
        downwards = np.arcsin(np.clip(-ahead[:, 2], -1, 1))
        allowed = np.arcsin(np.clip(height / length_m, 0, 1))
        up = np.zeros((len(vectors), 3))
        up[:, 0] = -_steady(np.clip(downwards - allowed, 0, MOST_RAD), time_s)
        vectors[:, toe] = rotmat_to_rotvec(R_local @ rotvec_to_rotmat(up))
    return replace(motion, vectors=vectors)


def _steady(angle: Float[Array, " N"], time_s: Float[Array, " N"]) -> Float[Array, " N"]:
    if len(time_s) < 2:
        return angle
    size = max(1, round(STEADY_S / float(np.median(np.diff(time_s)))))
    return np.asarray(uniform_filter1d(uniform_filter1d(angle, size, mode="nearest"), size, mode="nearest"))
