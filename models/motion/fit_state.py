"""What a fit moves and what its terms look at: one person's motion in a reference frame, and cameras that see it.

The reference frame is the term writer's choice: the shot's own axes when one shot is fitted, the world when all are.
A step δ has 63 numbers a frame: root rotation (3), pelvis (3), and one rotation (3) for each of 19 body joints.
Rotations are updated on the right, R ← R exp(δ), so that a step is an angular displacement in the joint's own axes.
Toes and hands (joints 10, 11, 22, 23) stay as they are: no landmark moves with them alone.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from humanmm.models.body.body24 import NUM_JOINTS, PARENTS
from humanmm.models.body.kinematics import compose
from humanmm.models.rotations import rotation_from_vector

Array = np.ndarray

FREE_JOINTS = tuple(j for j in range(1, NUM_JOINTS) if j not in (10, 11, 22, 23))
"""Body joints that a fit turns, in the order of their parameters."""

NUM_PARAMETERS = 6 + 3 * len(FREE_JOINTS)

ROOT, PELVIS, BODY = slice(0, 3), slice(3, 6), slice(6, NUM_PARAMETERS)
"""Where the parts of a step stand."""


def _movers() -> np.ndarray:
    """(24, 20) bool: does joint k move when the root or free joint i turns? (Its own position never does.)"""
    turning = (0, *FREE_JOINTS)
    moves = np.zeros((NUM_JOINTS, len(turning)), bool)
    for k in range(1, NUM_JOINTS):
        moves[k] = moves[PARENTS[k]] | (np.array(turning) == PARENTS[k])
    return moves


_MOVES_JOINT = _movers()
_TURNING = np.array((0, *FREE_JOINTS))


@dataclass(frozen=True, eq=False)
class Skeleton:
    """One person's fixed measures: rest joints, and K tracked points that ride on joints (see `body.landmarks`)."""

    rest_joints: Float[Array, "24 3"]
    point_joint: Int[Array, " K"]
    point_offset: Float[Array, "K 3"]

    @cached_property
    def _moves_point(self) -> np.ndarray:
        """(K, 20) bool: a point moves with its own joint too."""
        own = self.point_joint[:, None] == _TURNING[None]
        return np.asarray(_MOVES_JOINT[self.point_joint] | own)


@dataclass(frozen=True, eq=False)
class Motion:
    """N frames of one person in a reference frame; `posed` properties are computed when first asked for."""

    skeleton: Skeleton
    R_ref_root: Float[Array, "N 3 3"]
    pelvis_ref: Float[Array, "N 3"]
    R_body: Float[Array, "N 23 3 3"]
    """Joint rotations relative to their parents."""

    @property
    def num_frames(self) -> int:
        return len(self.pelvis_ref)

    def moved(self, step: Float[Array, "N 63"]) -> "Motion":
        """The motion after one step."""
        R_body = self.R_body.copy()
        free = np.array(FREE_JOINTS) - 1
        R_body[:, free] = R_body[:, free] @ rotation_from_vector(step[:, BODY].reshape(len(step), -1, 3))
        return Motion(
            self.skeleton,
            self.R_ref_root @ rotation_from_vector(step[:, ROOT]),
            self.pelvis_ref + step[:, PELVIS],
            R_body,
        )

    def frames(self, chosen: slice) -> "Motion":
        """A run of frames."""
        return Motion(self.skeleton, self.R_ref_root[chosen], self.pelvis_ref[chosen], self.R_body[chosen])

    @cached_property
    def posed(self) -> tuple[Float[Array, "N 24 3"], Float[Array, "N 24 3 3"]]:
        """Joint positions and rotations in the reference frame."""
        R_local = np.concatenate([self.R_ref_root[:, None], self.R_body], axis=1)
        return compose(self.skeleton.rest_joints, R_local, self.pelvis_ref)

    @cached_property
    def points(self) -> Float[Array, "N K 3"]:
        """Tracked points in the reference frame, metres."""
        joints, R = self.posed
        k = self.skeleton.point_joint
        return np.asarray(joints[:, k] + (R[:, k] @ self.skeleton.point_offset[..., None])[..., 0])

    @cached_property
    def point_jacobian(self) -> Float[Array, "N K 3 63"]:
        """∂ points / ∂ step: turning joint j by δ in its own axes moves a point p below it by (R_j δ) × (p − p_j)."""
        joints, R = self.posed
        arm = self.points[:, :, None] - joints[:, None, _TURNING]  # (N, K, 20, 3)
        arm *= self.skeleton._moves_point[None, :, :, None]
        axes = R[:, _TURNING]  # columns: the joint's axes in the reference frame
        J = np.empty((self.num_frames, arm.shape[1], 3, NUM_PARAMETERS))
        J[..., PELVIS] = np.eye(3)
        turns = np.empty((self.num_frames, arm.shape[1], 3, len(_TURNING), 3))
        for row in range(3):  # (axis × arm)[row], for the three axes of every turning joint at once
            a, b = (row + 1) % 3, (row + 2) % 3
            turns[:, :, row] = axes[:, None, :, a] * arm[..., b, None] - axes[:, None, :, b] * arm[..., a, None]
        J[..., ROOT] = turns[..., 0, :]
        J[..., BODY] = turns[..., 1:, :].reshape(*turns.shape[:3], -1)
        return J


@dataclass(frozen=True, eq=False)
class CameraPath:
    """The camera of each frame as seen from the reference frame: x_cam = R_cam_ref x_ref + t_cam_ref."""

    R_cam_ref: Float[Array, "N 3 3"]
    t_cam_ref: Float[Array, "N 3"]
    K: Float[Array, "N 3 3"]

    def frames(self, chosen: slice) -> "CameraPath":
        """A run of frames."""
        return CameraPath(self.R_cam_ref[chosen], self.t_cam_ref[chosen], self.K[chosen])

    def to_camera(self, points_ref: Float[Array, "N K 3"]) -> Float[Array, "N K 3"]:
        """Points of each frame in the axes of its camera."""
        return np.asarray(points_ref @ np.swapaxes(self.R_cam_ref, -1, -2) + self.t_cam_ref[:, None])
