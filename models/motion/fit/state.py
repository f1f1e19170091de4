"""What a fit moves and what its terms look at: one person's motion in a reference frame, and cameras that see it.

The reference frame is the term writer's choice: the shot's own axes when one shot is fitted, the world when all are.
A step δ has 63 numbers a frame: root rotation (3), pelvis (3), and one rotation (3) for each of 19 body joints.
Rotations are updated on the right, R ← R exp(δ), so that a step is an angular displacement in the joint's own axes.
Toes and hands (joints 10, 11, 22, 23) stay as they are: no landmark moves with them alone.
"""

from collections.abc import Hashable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import DTypeLike

from humanmm.models.body.body24 import FREE_JOINTS, NUM_JOINTS, PARENTS, ROTATED_JOINTS
from humanmm.models.body.kinematics import compose
from humanmm.models.geometry.projection import camera_to_world
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat

Array = np.ndarray

NUM_PARAMETERS = 6 + 3 * len(FREE_JOINTS)
NUM_ROTATIONS = len(ROTATED_JOINTS)
"""The root's and the free joints'."""

ROOT, PELVIS, BODY = slice(0, 3), slice(3, 6), slice(6, NUM_PARAMETERS)
"""Where the parts of a step stand."""


def _movers() -> np.ndarray:
    """(24, 20) bool: whether joint k moves when the root or free joint i rotates; its own position never does."""
    moves = np.zeros((NUM_JOINTS, NUM_ROTATIONS), bool)
    for k in range(1, NUM_JOINTS):
        moves[k] = moves[PARENTS[k]] | (np.array(ROTATED_JOINTS) == PARENTS[k])
    return moves


_MOVES_JOINT = _movers()
_TURNING = np.array(ROTATED_JOINTS)


@dataclass(frozen=True, eq=False)
class Skeleton:
    """One person's fixed measures: rest joints, and K tracked points that ride on joints (see `body.landmarks`)."""

    rest_joints: Float[Array, "24 3"]
    point_joint: Int[Array, " K"]
    point_offset: Float[Array, "K 3"]

    @cached_property
    def moves_point(self) -> Float[Array, "K 63"]:
        """1 where a number of a step moves a point, else 0; a point moves with its own joint too."""
        moved = _MOVES_JOINT[self.point_joint] | (self.point_joint[:, None] == _TURNING)
        moves = np.ones((len(self.point_joint), NUM_PARAMETERS), np.float32)
        moves[:, BODY] = np.repeat(moved[:, 1:], 3, axis=1)
        return moves


@dataclass(frozen=True, eq=False)
class Motion:
    """N frames of one person in a reference frame; `posed` properties are computed at their first use."""

    skeleton: Skeleton
    R_ref_root: Float[Array, "N 3 3"]
    pelvis_ref: Float[Array, "N 3"]
    R_body: Float[Array, "N 23 3 3"]
    """Joint rotations relative to their parents."""

    @classmethod
    def of(cls, skeleton: Skeleton, R_local: Float[Array, "N 24 3 3"], pelvis_ref: Float[Array, "N 3"]) -> "Motion":
        """A motion whose root and joints stand in one array, without a copy of it."""
        motion = cls(skeleton, R_local[:, 0], pelvis_ref, R_local[:, 1:])
        motion.__dict__["R_local"] = R_local
        return motion

    def with_points(self, skeleton: Skeleton) -> "Motion":
        """The same motion of the same body with other tracked points."""
        motion = Motion.of(skeleton, self.R_local, self.pelvis_ref)
        motion.__dict__["posed"] = self.posed
        return motion

    @property
    def num_frames(self) -> int:
        return len(self.pelvis_ref)

    @cached_property
    def R_local(self) -> Float[Array, "N 24 3 3"]:  # noqa: N802 (a rotation matrix, as everywhere)
        """Root and joints in one array."""
        return np.concatenate([self.R_ref_root[:, None], self.R_body], axis=1)

    @cached_property
    def cache(self) -> dict[Hashable, Any]:
        """What terms found out about this motion (`equations.memoised`)."""
        return {}

    @cached_property
    def free_rotations(self) -> Float[Array, "N 20 3 3"]:
        """Local rotations of the root and the free joints."""
        return np.asarray(self.R_local[:, _TURNING])

    def moved(self, step: Float[Array, "N 63"]) -> "Motion":
        """The motion after one step."""
        rotated = self.free_rotations @ rotvec_to_rotmat(
            np.concatenate([step[:, ROOT], step[:, BODY]], axis=1).reshape(-1, NUM_ROTATIONS, 3)
        )
        R = self.R_local.copy()
        R[:, _TURNING] = rotated
        return Motion.of(self.skeleton, R, self.pelvis_ref + step[:, PELVIS])

    @cached_property
    def posed(self) -> tuple[Float[Array, "N 24 3"], Float[Array, "N 24 3 3"]]:
        """Joint positions and rotations in the reference frame."""
        return compose(self.skeleton.rest_joints, self.R_local, self.pelvis_ref)

    @cached_property
    def points(self) -> Float[Array, "N K 3"]:
        """Tracked points in the reference frame, metres."""
        joints, R = self.posed
        k = self.skeleton.point_joint
        return np.asarray(joints[:, k] + (R[:, k] @ self.skeleton.point_offset[..., None])[..., 0])

    @cached_property
    def _twists(self) -> Float[Array, "N 6 63"]:
        """What each number of a step does to the body, as angular velocity and velocity at the pelvis: joint j rotating
        about its axis a gives (a, (p_j − pelvis) × a)."""
        joints, R = self.posed
        axes = R[:, _TURNING]  # columns: the joint's axes in the reference frame
        arm = (joints[:, _TURNING] - self.pelvis_ref[:, None])[..., None]
        twists = np.zeros((self.num_frames, 6, NUM_PARAMETERS))
        rotation_twists = np.empty((self.num_frames, 6, len(_TURNING), 3))
        for row in range(3):
            a, b = (row + 1) % 3, (row + 2) % 3
            rotation_twists[:, row] = axes[:, :, row]
            rotation_twists[:, 3 + row] = arm[:, :, a] * axes[:, :, b] - arm[:, :, b] * axes[:, :, a]
        twists[..., ROOT] = rotation_twists[:, :, 0]
        twists[..., BODY] = rotation_twists[:, :, 1:].reshape(self.num_frames, 6, -1)
        twists[:, 3:, PELVIS] = np.eye(3)
        return twists

    def point_rows(
        self, frames: slice, which: Int[Array, " R"], along: Float[Array, "n R 3"], *, dtype: DTypeLike = np.float64
    ) -> Float[Array, "n R 63"]:
        """∂ (along · points[which]) / ∂ step for a run of n frames.

        Turning joint j about its axis a moves a point p below it by a × (p − p_j). The part of p alone and that of j
        alone are kept apart, so that all rows and columns of a frame are one small matrix product.
        """
        arm = self.points[frames][:, which] - self.pelvis_ref[frames, None]
        wrench = np.empty((*along.shape[:2], 6), dtype)
        for row in range(3):
            a, b = (row + 1) % 3, (row + 2) % 3
            wrench[..., row] = arm[..., a] * along[..., b] - arm[..., b] * along[..., a]
        wrench[..., 3:] = along
        rows = wrench @ self._twists[frames].astype(dtype, copy=False)
        rows *= self.skeleton.moves_point[which]
        return np.asarray(rows)


@dataclass(frozen=True, eq=False)
class LongMotion:
    """N frames of one person as they are kept, however many: a fifth of the memory of their matrices.

    Rotation vectors in single precision are exact to 2e-7 rad; work is done on runs of frames in double precision.
    """

    skeleton: Skeleton
    vectors: Float[Array, "N 24 3"]
    """float32, radians: the root's in the reference frame, the joints' relative to their parents."""
    pelvis_ref: Float[Array, "N 3"]

    @classmethod
    def empty(cls, skeleton: Skeleton, num_frames: int) -> "LongMotion":
        """A motion in the rest pose at the origin, to be filled run by run."""
        return cls(skeleton, np.zeros((num_frames, NUM_JOINTS, 3), np.float32), np.zeros((num_frames, 3)))

    @property
    def num_frames(self) -> int:
        return len(self.pelvis_ref)

    def frames(self, chosen: slice) -> Motion:
        """A run of frames."""
        return Motion.of(self.skeleton, rotvec_to_rotmat(self.vectors[chosen]), self.pelvis_ref[chosen])

    def put(self, chosen: slice, motion: Motion) -> None:
        """Overwrite a run of frames."""
        self.vectors[chosen] = rotmat_to_rotvec(motion.R_local)
        self.pelvis_ref[chosen] = motion.pelvis_ref


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
        return camera_to_world(points_ref, self.R_cam_ref, self.t_cam_ref)
