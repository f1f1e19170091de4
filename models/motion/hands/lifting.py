"""Angles of the fingers from 21 landmarks in space: the likeliest hand, frame by frame.

The palm's landmarks give its axes (Kabsch 1976). In these, each finger is the five angles that minimise
Σ |bone − landmarks' direction|² / σ² + ((angle − at ease) / spread)² + (last joint − ⅔ middle joint)² / σ_c²
(Gauss-Newton), within the ranges of motion.
"""

import numpy as np
from jaxtyping import Float

from humanmm.models.geometry.rotations import nearest_rotation, unit
from humanmm.models.motion.hands.finger_joints import (
    AT_EASE,
    BEND2,
    BEND3,
    FAR_PER_MIDDLE,
    FAR_SIGMA,
    HIGHEST,
    LOWEST,
    NUM_ANGLES,
    SPREAD_OUT,
    finger_directions,
    hand_at_rest,
)

Array = np.ndarray

PALM = (0, 5, 9, 13, 17)
"""Landmarks of the palm: wrist, and the bases of index, middle, ring and little finger."""
CHAINS = ((5, 6, 7, 8), (9, 10, 11, 12), (17, 18, 19, 20), (13, 14, 15, 16), (1, 2, 3, 4))
"""Landmarks of each finger of SMPL-H's order, from its base to its tip."""

DIRECTION_SIGMA = 0.15
"""Expected error of the direction of a bone, radians."""
_ROUNDS = 6
_STEP = 1e-4


def palm_rotation(points3d: Float[Array, "n 21 3"], side: int) -> Float[Array, "n 3 3"]:
    """Rotation from the axes of the body at rest to those of the landmarks, of the left (0) or right (1) palm."""
    rest = hand_at_rest(side).palm
    seen = points3d[:, PALM]
    seen = seen - seen.mean(axis=1, keepdims=True)
    return nearest_rotation(np.einsum("nka,kb->nab", seen, rest - rest.mean(axis=0)))


def finger_angles(points3d: Float[Array, "n 21 3"], side: int) -> Float[Array, "n 5 5"]:
    """Angles of the fingers of the left (0) or right (1) hand, `finger_joints`; any unit, any axes."""
    points = points3d.astype(np.float64)
    bones = unit(np.diff(points[:, CHAINS], axis=2))
    seen = np.einsum("nba,nfkb->nfka", palm_rotation(points, side), bones)
    angles = np.tile(AT_EASE, (len(points), 1, 1))
    for _ in range(_ROUNDS):
        residual = _residual(side, angles, seen)
        J = np.stack(
            [(_residual(side, angles + _STEP * one, seen) - residual) / _STEP for one in np.eye(NUM_ANGLES)], axis=-1
        )
        step = np.linalg.solve(np.swapaxes(J, -1, -2) @ J, -np.einsum("nfra,nfr->nfa", J, residual)[..., None])
        angles = np.clip(angles + step[..., 0], LOWEST, HIGHEST)
    return angles


def _residual(side: int, angles: Float[Array, "n 5 5"], seen: Float[Array, "n 5 3 3"]) -> Float[Array, "n 5 r"]:
    apart = (finger_directions(side, angles) - seen) / DIRECTION_SIGMA
    last = (angles[..., BEND3] - AT_EASE[:, BEND3]) - FAR_PER_MIDDLE * (angles[..., BEND2] - AT_EASE[:, BEND2])
    parts = (apart.reshape(*angles.shape[:2], 9), (angles - AT_EASE) / SPREAD_OUT, last[..., None] / FAR_SIGMA)
    return np.concatenate(parts, axis=-1)
