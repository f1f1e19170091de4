"""Forward kinematics and linear blend skinning, batched over frames.

p_j = p_parent + R_parent (rest_j − rest_parent),  R_j = R_parent exp(θ_j); the root has rotation R_root and position
`pelvis`. Rotations map a joint's axes to the frame that R_root and pelvis are given in (world or camera).
"""

from collections.abc import Callable, Iterator

import numpy as np
from jaxtyping import Float

from humanmm.models.body.body24 import FREE_JOINTS, PARENTS
from humanmm.models.geometry.rotations import rotvec_to_rotmat

Array = np.ndarray

CHUNK_FRAMES = 512
"""Frames whose intermediate numbers, many times as large as the result, are in memory at the same time."""


def chunks(num_frames: int, most: int = CHUNK_FRAMES) -> Iterator[slice]:
    """Runs of frames, `most` or fewer, that together are all."""
    for start in range(0, num_frames, most):
        yield slice(start, min(start + most, num_frames))


def by_chunks(function: Callable[[Array], Array], values: Array) -> Array:
    """The function of every frame, a chunk of frames at a time: what it needs meanwhile stays small."""
    if len(values) <= CHUNK_FRAMES:
        return function(values)
    first = function(values[:CHUNK_FRAMES])
    result = np.empty((len(values), *first.shape[1:]), first.dtype)
    for frames in chunks(len(values)):
        result[frames] = first if frames.start == 0 else function(values[frames])
    return result


def local_rotations(
    R_root: Float[Array, "frames 3 3"], body_pose: Float[Array, "frames J-1 3"]
) -> Float[Array, "frames J 3 3"]:
    """Every joint's rotation relative to its parent; the root's is R_root."""
    return np.concatenate([np.asarray(R_root, np.float64)[:, None], rotvec_to_rotmat(body_pose)], axis=1)


def seen_rotations(
    R_root: Float[Array, "*batch 3 3"], body_pose: Float[Array, "*batch 23 3"]
) -> Float[Array, "*batch 20 3 3"]:
    """R_root and the free joints' local rotations: those that can be seen, in the order of `body24.ROTATED_JOINTS`."""
    free = rotvec_to_rotmat(np.asarray(body_pose, np.float64)[..., [joint - 1 for joint in FREE_JOINTS], :])
    return np.concatenate([np.asarray(R_root, np.float64)[..., None, :, :], free], axis=-3)


def compose(
    rest_joints: Float[Array, "J 3"],
    R_local: Float[Array, "frames J 3 3"],
    pelvis: Float[Array, "frames 3"],
    parents: tuple[int, ...] = PARENTS,
) -> tuple[Float[Array, "frames J 3"], Float[Array, "frames J 3 3"]]:
    """Joint positions and joint rotations from local rotations; `parents` are the body's."""
    R = np.empty_like(R_local)
    joints = np.empty((len(R_local), len(parents), 3))
    R[:, 0], joints[:, 0] = R_local[:, 0], pelvis
    for j in range(1, len(parents)):
        parent = parents[j]
        R[:, j] = R[:, parent] @ R_local[:, j]
        joints[:, j] = joints[:, parent] + R[:, parent] @ (rest_joints[j] - rest_joints[parent])
    return joints, R


def forward_kinematics(
    rest_joints: Float[Array, "J 3"],
    R_root: Float[Array, "frames 3 3"],
    body_pose: Float[Array, "frames J-1 3"],
    pelvis: Float[Array, "frames 3"],
    parents: tuple[int, ...] = PARENTS,
) -> tuple[Float[Array, "frames J 3"], Float[Array, "frames J 3 3"]]:
    """Joint positions (metres) and joint rotations from pose parameters, as `records.motion.PersonMotion` has them.

    `rest_joints` is `body.rest_joints(betas)`; only differences of it are used, so `pelvis` is the pelvis joint itself.
    J is 24, or 52 with fingers; `parents` are the body's.
    """
    return compose(rest_joints, local_rotations(R_root, body_pose), pelvis, parents)


def skinning_transforms(
    rest_joints: Float[Array, "J 3"], joints: Float[Array, "frames J 3"], R: Float[Array, "frames J 3 3"]
) -> Float[Array, "frames J 3 4"]:
    """[R | t] of each joint that takes a rest-pose point to the posed body: x = R x_rest + t."""
    t = joints - np.einsum("njab,jb->nja", R, rest_joints)
    return np.concatenate([R, t[..., None]], axis=-1)
