"""One person's motion over all shots, as the motion networks read it: a fixed rate, and nothing that says where the
person is or where he faces, for neither changes how people move.
"""

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from humanmm.models.body.body24 import FREE_JOINTS, NUM_JOINTS, PARENTS, ROTATED_JOINTS
from humanmm.models.perception.lifting.network import Tensors
from humanmm.models.records.recording import CONTACT_JOINTS

RATE_HZ = 30.0
"""All motion is brought to this rate: a network then sees the same steps whatever the video's rate is."""
JOINTS = len(ROTATED_JOINTS)
FASTEST_TURN, FASTEST_MS, FASTEST_FOOT_MS = 20.0, 8.0, 12.0
"""Limits of what is read: rad/s of the root, m/s of pelvis and feet. What is faster is an error or a cut."""


@dataclass(frozen=True, eq=False)
class MotionSequence(Tensors):
    """B people or windows of n frames, RATE_HZ frames a second; world z up, metres."""

    rotations: Tensor
    """(B,n,20,3,3): the root's in the world, those of the free joints relative to their parents."""
    pelvis: Tensor
    """(B,n,3)."""
    rest_joints: Tensor
    """(B,24,3)."""
    known: Tensor
    """(B,n) bool: seen; other frames hold what the neighbours say."""
    confidence: Tensor
    """(B,n), 0..1."""
    shot: Tensor
    """(B,n) int: the shot's index."""

    def rotated_to(self, rotations: Tensor) -> "MotionSequence":
        """The same with other rotations."""
        return replace(self, rotations=rotations)

    @property
    def up(self) -> Tensor:
        """(B,n,3): the vertical in the root's axes."""
        return self.rotations[:, :, 0, 2]

    def pose_features(self) -> Tensor:
        """(B,n,c): the body's pose, how it stands against gravity and turns, and where its feet are in its own axes."""
        R = self.rotations[:, :, 0]
        relative = product(R[:, :-1].transpose(-1, -2), R[:, 1:])
        turn = _limited(small_rotvec(relative) * RATE_HZ, FASTEST_TURN) * self.steps_within_shots[..., None]
        feet = rotated(R.transpose(-1, -2)[:, :, None], feet_of(self) - self.pelvis[:, :, None])
        parts = [sixes(self.rotations[:, :, 1:]).flatten(2), self.up, _padded(turn) / 5, feet.flatten(2)]
        return torch.cat(parts, dim=-1)

    def path_features(self) -> Tensor:
        """(B,n,c): what the cameras say of the path: velocities of pelvis and feet in the root's axes, heights of the
        feet above the lowest of the last and next half second, and how far all this was seen."""
        R = self.rotations[:, :, 0]
        feet = feet_of(self)
        within = self.steps_within_shots[..., None]
        R_root_world = R[:, :-1].transpose(-1, -2)
        of_pelvis = rotated(R_root_world, self.pelvis.diff(dim=1) * RATE_HZ)
        of_feet = rotated(R_root_world[:, :, None], feet.diff(dim=1) * RATE_HZ)
        height = feet[..., 2]
        reach = int(RATE_HZ / 2)
        lowest = -torch.nn.functional.max_pool1d(-height.amin(dim=-1)[:, None], 2 * reach + 1, 1, reach)[:, 0]
        parts = [
            _padded(_limited(of_pelvis, FASTEST_MS) * within),
            _padded(_limited(of_feet, FASTEST_FOOT_MS).flatten(2) * within),
            (height - lowest[..., None]).clamp(0, 1),
            self.known[..., None].float(),
            self.confidence[..., None],
            _padded(1 - within),
        ]
        return torch.cat(parts, dim=-1)

    @property
    def steps_within_shots(self) -> Tensor:
        """(B,n-1), 1 or 0: both frames of a step belong to one shot."""
        return (self.shot[:, 1:] == self.shot[:, :-1]).float()


POSE_FEATURES = len(FREE_JOINTS) * 6 + 3 + 3 + 12
PATH_FEATURES = 3 + 12 + 4 + 3


def _limited(values: Tensor, most: float) -> Tensor:
    return values.clamp(-most, most)


def _padded(steps: Tensor) -> Tensor:
    """Values of steps as values of frames: that of the step which begins there; the last one's is repeated."""
    return torch.cat([steps, steps[:, -1:]], dim=1)


def sixes(R: Tensor) -> Tensor:
    """(…,3,3) → (…,6): the first two columns (Zhou et al. 2019)."""
    return torch.cat([R[..., 0], R[..., 1]], dim=-1)


def small_rotvec(R: Tensor) -> Tensor:
    """(…,3,3) → (…,3): the rotation vector, times sin(angle) / angle; exact for small rotations."""
    x, y, z = R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]
    return torch.stack([x, y, z], dim=-1) / 2


def product(A: Tensor, B: Tensor) -> Tensor:
    """A @ B of many 3 × 3 matrices (…,3,3): ten times as fast as the general product on a CPU."""
    return (A[..., :, :, None] * B[..., None, :, :]).sum(dim=-2)


def rotated(R: Tensor, v: Tensor) -> Tensor:
    """R v of (…,3,3) and (…,3)."""
    return (R * v[..., None, :]).sum(dim=-1)


def joints_of(motion: MotionSequence) -> Tensor:
    """(B,n,24,3): forward kinematics, world."""
    return posed(motion.rest_joints, motion.rotations, motion.pelvis)


def feet_of(motion: MotionSequence) -> Tensor:
    """(B,n,4,3): `CONTACT_JOINTS`, world."""
    return joints_of(motion)[:, :, list(CONTACT_JOINTS)]


def posed(rest_joints: Tensor, rotations: Tensor, pelvis: Tensor) -> Tensor:
    """Joints (B,n,24,3) of rest joints (B,24,3), rotations (B,n,20,3,3) of `ROTATED_JOINTS` and a pelvis (B,n,3)."""
    number = {joint: k for k, joint in enumerate(ROTATED_JOINTS)}
    R, joints = [rotations[:, :, 0]], [pelvis]
    for joint in range(1, NUM_JOINTS):
        parent = PARENTS[joint]
        offset = (rest_joints[:, joint] - rest_joints[:, parent])[:, None]
        joints.append(joints[parent] + rotated(R[parent], offset))
        R.append(product(R[parent], rotations[:, :, number[joint]]) if joint in number else R[parent])
    return torch.stack(joints, dim=2)
