"""How fingers bend: the axes of their joints on the body at rest, the hand at ease, and how far a joint goes.

A finger has five angles: at its base it bends, spreads and twists, at its other two joints it bends. Angles are radians
from the body at rest, whose hands are nearly flat; bending towards the palm is positive.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int

from humanmm.models.body.body24 import Body
from humanmm.models.body.fingers import FINGERS, NUM_BODY_JOINTS, WRISTS, load_body52
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat, unit

Array = np.ndarray

NUM_ANGLES = 5
BEND1, SPREAD, TWIST, BEND2, BEND3 = range(NUM_ANGLES)
_THUMB = FINGERS.index("Thumb")
_TIP_VERTICES = 12

AT_EASE = np.deg2rad(
    [[12, 0, 0, 20, 12], [18, 0, 0, 25, 14], [22, 0, 0, 25, 14], [22, 0, 0, 28, 16], [5, 0, 0, 10, 10]]
)
"""Angles of a hand that does nothing, of each finger of SMPL-H. With the bend of the body's hand at rest (11° to
29° at the base, 4° to 8° further out) this is the hand's position of rest: fingers bent, the little finger most."""
SPREAD_OUT = np.deg2rad([[35, 10, 2, 40, 25], [35, 8, 2, 40, 25], [35, 10, 2, 40, 25], [35, 8, 2, 40, 25],
                         [25, 25, 20, 25, 30]])  # fmt: skip
"""How far hands are from that, standard deviations. Only the thumb twists."""
LOWEST = np.deg2rad([[-40, -22, -5, -15, -15]] * 4 + [[-45, -50, -45, -45, -35]])
HIGHEST = np.deg2rad([[75, 22, 5, 105, 80]] * 4 + [[55, 50, 45, 60, 80]])
"""Ranges of motion (American Academy of Orthopaedic Surgeons 1965), counted from the body at rest."""
FAR_PER_MIDDLE, FAR_SIGMA = 2 / 3, np.deg2rad(15)
"""A finger's last joint bends with the one before (Rijpkema and Girard 1991)."""


@dataclass(frozen=True, eq=False)
class HandAtRest:
    """One hand of the body at rest, axes of the body."""

    palm: Float[Array, "5 3"]
    """Wrist, and the bases of the index, middle, ring and little finger."""
    bones: Float[Array, "5 3 3"]
    """Unit directions of each finger's three bones, from its base to its tip; fingers in SMPL-H's order."""
    bend: Float[Array, "5 3"]
    """Axis about which each finger bends."""
    spread: Float[Array, "5 3"]


@lru_cache(maxsize=2)
def hand_at_rest(side: int) -> HandAtRest:
    """The left (0) or right (1) hand of the body of average shape."""
    body = load_body52()
    first = NUM_BODY_JOINTS + 15 * side
    joints = body.J_template[first : first + 15].reshape(5, 3, 3)
    chains = np.concatenate([joints, fingertips(body, side)[:, None]], axis=1)
    bones = unit(np.diff(chains, axis=1))
    index, middle, pinky, ring = joints[:_THUMB, 0]
    wrist = body.J_template[WRISTS[side]]
    back = unit(np.cross(index - wrist, pinky - wrist)) * (1 - 2 * side)  # the back of both hands is up at rest
    bend = unit(np.cross(back, bones[:, 0]))
    nail = unit(back + unit(index - pinky))  # the thumb's looks half backwards, half away from the little finger
    bend[_THUMB] = unit(np.cross(nail, bones[_THUMB, 0]))
    spread = unit(np.cross(bones[:, 0], bend))
    return HandAtRest(np.stack([wrist, index, middle, ring, pinky]), bones, bend, spread)


def fingertips(body: Body, side: int) -> Float[Array, "5 3"]:
    """Ends of the fingers of the left (0) or right (1) hand at rest: the skin that is furthest out."""
    vertices = body.v_template.astype(np.float64)
    owner = body.skin_joint[np.arange(len(vertices)), body.skin_weight.argmax(axis=1)]
    tips = []
    for finger in range(5):
        last = NUM_BODY_JOINTS + 15 * side + 3 * finger + 2
        own = np.flatnonzero(owner == last)
        out = body.J_template[last] - body.J_template[last - 1]
        furthest: Int[Array, " n"] = own[np.argsort(-(vertices[own] @ out), kind="stable")[:_TIP_VERTICES]]
        tips.append(vertices[furthest].mean(axis=0))
    return np.stack(tips)


def finger_rotations(side: int, angles: Float[Array, "*n 5 5"]) -> Float[Array, "*n 5 3 3 3"]:
    """Each joint's rotation relative to its parent, axes of the body at rest: fingers, then joints outwards."""
    rest = hand_at_rest(side)

    def about(axes: Float[Array, "5 3"], angle: int) -> Float[Array, "*n 5 3 3"]:
        return rotvec_to_rotmat(axes * angles[..., angle, None])

    base = about(rest.spread, SPREAD) @ about(rest.bend, BEND1) @ about(rest.bones[:, 0], TWIST)
    return np.stack([base, about(rest.bend, BEND2), about(rest.bend, BEND3)], axis=-3)


def finger_directions(side: int, angles: Float[Array, "*n 5 5"]) -> Float[Array, "*n 5 3 3"]:
    """Unit directions of the bones, axes of the palm."""
    bones = hand_at_rest(side).bones
    R = finger_rotations(side, angles)
    middle = R[..., 0, :, :] @ R[..., 1, :, :]
    turned = (R[..., 0, :, :], middle, middle @ R[..., 2, :, :])
    return np.stack([np.einsum("...ab,...b->...a", R_bone, bones[:, k]) for k, R_bone in enumerate(turned)], axis=-2)


def hand_pose(angles: Float[Array, "n 2 5 5"]) -> Float[Array, "n 30 3"]:
    """Axis-angle of the 30 finger joints, SMPL-H's order."""
    R = np.stack([finger_rotations(side, angles[:, side]) for side in (0, 1)], axis=1)
    return rotmat_to_rotvec(R.reshape(len(angles), 30, 3, 3))
