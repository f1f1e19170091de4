"""Where a fit starts: closed-form inverse kinematics from 33 landmarks, and the pelvis from their projections.

Torso and head by Kabsch, limbs bone by bone; where an elbow or knee is bent, its hinge determines the twist of the bone
above it. All frames at once; no iteration.
"""

from typing import Protocol

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial.transform import Rotation, Slerp

from humanmm.models.body.body24 import JOINT_NAMES, PARENTS
from humanmm.models.geometry.alignment import kabsch
from humanmm.models.geometry.rotations import (
    nearest_rotation,
    rotmat_to_rotvec,
    rotvec_to_rotmat,
    swing,
    unit,
)
from humanmm.models.motion.fit.state import LongMotion, Skeleton

Array = np.ndarray


class InitialPose(Protocol):
    """Where the fit of a body begins: a pose near the network's landmarks. The fit repairs what is a little off."""

    def __call__(self, skeleton: Skeleton, landmarks_ref: Float[Array, "N 33 3"]) -> Float[Array, "N 24 3 3"]:
        """Rotations of the root (in the axes of the landmarks) and of 23 joints (to their parents) in N frames.

        Landmarks: metres, origin of no matter, left and right resolved, in the axes of the shot's reference camera.
        """
        ...


_FACE = (0, 2, 5, 7, 8)
_SPINE = (3, 6, 9)

_LIMBS = (
    # upper joint, lower joint, landmarks: upper end, hinge, lower end; hinge axis in the T-pose (flexion is positive)
    ("L_Shoulder", "L_Elbow", 11, 13, 15, (0.0, -1.0, 0.0)),
    ("R_Shoulder", "R_Elbow", 12, 14, 16, (0.0, 1.0, 0.0)),
    ("L_Hip", "L_Knee", 23, 25, 27, (1.0, 0.0, 0.0)),
    ("R_Hip", "R_Knee", 24, 26, 28, (1.0, 0.0, 0.0)),
)
_ENDS = (
    # joint, landmarks that ride on it or just below it (with the joint's own first)
    ("L_Wrist", (15, 17, 19, 21)),
    ("R_Wrist", (16, 18, 20, 22)),
    ("L_Ankle", (27, 29, 31)),
    ("R_Ankle", (28, 30, 32)),
)

_STRAIGHT = 0.1
"""Weight of the swing's own hinge axis against the seen one: decides the twist of straight limbs."""


def start_pose(skeleton: Skeleton, landmarks_ref: Float[Array, "N 33 3"]) -> Float[Array, "N 24 3 3"]:
    """Root and joint rotations that put a skeleton (with all 33 landmarks as points) near the landmarks.

    Landmarks are in the axes of the reference frame; their origin does not matter, their scale hardly.
    """
    n = len(landmarks_ref)
    rest = skeleton.rest_joints[skeleton.point_joint] + skeleton.point_offset  # T-pose landmarks
    R_local = np.broadcast_to(np.eye(3), (n, 24, 3, 3)).copy()
    ones = np.ones((n, 1))

    hips = landmarks_ref[:, 23] - landmarks_ref[:, 24]
    trunk = landmarks_ref[:, 11:13].mean(1) - landmarks_ref[:, 23:25].mean(1)
    chest = landmarks_ref[:, 11] - landmarks_ref[:, 12]
    rest_torso = np.stack([rest[23] - rest[24], rest[11:13].mean(0) - rest[23:25].mean(0)])
    # The hips say how the pelvis is rotated about the trunk, the shoulders how the chest is.
    R_root = nearest_rotation(_pairs(np.stack([unit(hips), unit(trunk)], 1), unit(rest_torso)))
    rest_chest = np.stack([rest[11] - rest[12], rest_torso[1]])
    R_chest = nearest_rotation(_pairs(np.stack([unit(chest), unit(trunk)], 1), unit(rest_chest)))
    R_local[:, 0] = R_root
    third = rotvec_to_rotmat(rotmat_to_rotvec(np.swapaxes(R_root, -1, -2) @ R_chest) / len(_SPINE))
    for j in _SPINE:
        R_local[:, j] = third

    face = np.array(_FACE)
    R_head = kabsch(np.broadcast_to(rest[face], (n, len(face), 3)), landmarks_ref[:, face], ones * np.ones(len(face)))
    half = rotvec_to_rotmat(rotmat_to_rotvec(np.swapaxes(R_chest, -1, -2) @ R_head) / 2)
    R_local[:, JOINT_NAMES.index("Neck")] = R_local[:, JOINT_NAMES.index("Head")] = half

    R_end: dict[int, Array] = {}
    for upper_name, lower_name, a, b, c, hinge in _LIMBS:
        upper, lower = JOINT_NAMES.index(upper_name), JOINT_NAMES.index(lower_name)
        R_parent = R_root if PARENTS[upper] == 0 else R_chest
        bone = np.einsum("nba,nb->na", R_parent, unit(landmarks_ref[:, b] - landmarks_ref[:, a]))
        below = np.einsum("nba,nb->na", R_parent, unit(landmarks_ref[:, c] - landmarks_ref[:, b]))
        rest_bone, rest_below, axis = unit(rest[b] - rest[a]), unit(rest[c] - rest[b]), np.array(hinge)
        by_swing = swing(np.broadcast_to(rest_bone, bone.shape), bone)
        seen_axis = np.cross(bone, below)  # as long as the limb is bent
        M = bone[..., :, None] * rest_bone + seen_axis[..., :, None] * axis
        M += _STRAIGHT * (by_swing @ axis)[..., :, None] * axis
        R_local[:, upper] = nearest_rotation(M)
        in_upper = np.einsum("nba,nb->na", R_local[:, upper], below)
        R_local[:, lower] = swing(np.broadcast_to(rest_below, in_upper.shape), in_upper)
        R_end[lower] = R_parent @ R_local[:, upper] @ R_local[:, lower]
    for name, points in _ENDS:
        j = JOINT_NAMES.index(name)
        which = np.array(points)
        R_parent = R_end[PARENTS[j]]
        seen = np.einsum("nba,nkb->nka", R_parent, landmarks_ref[:, which])
        R_local[:, j] = kabsch(np.broadcast_to(rest[which], seen.shape), seen, ones * np.ones(len(which)))
    return R_local


def interpolated(motion: LongMotion, known: Bool[Array, " N"], time_s: Float[Array, " N"]) -> LongMotion:
    """The motion with unknown frames replaced by interpolation in time (the nearest known frame at the ends)."""
    if known.all():
        return motion
    at = np.clip(time_s, time_s[known][0], time_s[known][-1])
    pelvis = np.stack([np.interp(at, time_s[known], motion.pelvis_ref[known, k]) for k in range(3)], axis=-1)
    vectors = motion.vectors.copy()
    if known.sum() > 1:
        for j in range(vectors.shape[1]):
            vectors[:, j] = Slerp(time_s[known], Rotation.from_rotvec(vectors[known, j]))(at).as_rotvec()
    else:
        vectors[:] = vectors[known]
    return LongMotion(motion.skeleton, vectors, pelvis)


def _pairs(seen: Float[Array, "N P 3"], rest: Float[Array, "P 3"]) -> Float[Array, "N 3 3"]:
    """Σ seen restᵀ: the matrix whose nearest rotation takes rest directions to seen ones."""
    return np.asarray(np.einsum("npi,pj->nij", seen, rest))
