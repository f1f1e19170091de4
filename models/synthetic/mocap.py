"""Sequences of motion capture on our own body: what the benchmark's videos show.

A pack knows one generic skeleton. Every video gets a body of its own: the sequence's joint rotations on a random shape
of body24, the path scaled with the legs so that feet which stand still do so on the new body too, and standing soles on
the floor. World: z up, metres.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation, Slerp

from humanmm.models.body.body24 import NUM_JOINTS, Body, load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.geometry.axes import R_ZUP_YUP
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.refine.refine import sole_heights
from humanmm.models.records.recording import CONTACT_JOINTS

Array = np.ndarray

PACK_RATE_HZ = 30.0
"""Sequences at a multiple of this are thinned out to it: the paper's videos have 30 frames a second."""
SHAPE_DEVIATION = 0.7
"""Standard deviation of the random shape components (body24's have unit variance, children and giants among them)."""
SHORTEST_M, TALLEST_M = 1.5, 1.98
"""Adults of usual size: bodies outside are drawn again."""


@dataclass(frozen=True)
class MocapSequence:
    """One sequence of a pack, N frames, world z up."""

    name: str
    fps: float
    R_world_root: Float[Array, "N 3 3"]
    body_pose: Float[Array, "N 23 3"]
    pelvis: Float[Array, "N 3"]
    contacts: Float[Array, "N 4"]
    leg_m: float
    """Thigh and shank of the pack's skeleton."""
    action: str = ""
    """What is done, in the pack's words."""
    subject: str = ""
    """Whose motion it is."""

    @property
    def num_frames(self) -> int:
        return len(self.pelvis)

    def cropped(self, start: int, num_frames: int) -> "MocapSequence":
        """A run of frames."""
        rows = slice(start, start + num_frames)
        return replace(
            self, R_world_root=self.R_world_root[rows], body_pose=self.body_pose[rows], pelvis=self.pelvis[rows],
            contacts=self.contacts[rows],
        )  # fmt: skip


@dataclass(frozen=True)
class Actor:
    """A sequence on a body, N frames."""

    betas: Float[Array, " 10"]
    R_world_root: Float[Array, "N 3 3"]
    body_pose: Float[Array, "N 23 3"]
    joints: Float[Array, "N 24 3"]
    R_world_joint: Float[Array, "N 24 3 3"]
    contacts: Float[Array, "N 4"]


def sequences_of_pack(arrays: Mapping[str, Array]) -> tuple[MocapSequence, ...]:
    """All sequences of a pack (its arrays, checked): world z up instead of y up, thinned out to about PACK_RATE_HZ."""
    step = max(1, round(float(arrays["fps"]) / PACK_RATE_HZ))
    leg_m = leg_length(arrays["rest_joints"].astype(np.float64))
    R = rotvec_to_rotmat(arrays["poses"][:, :3])
    names, starts, lengths = (arrays[key].tolist() for key in ("clip_name", "clip_start", "clip_len"))
    unknown = np.full(len(names), "")
    actions, subjects = (arrays.get(key, unknown).tolist() for key in ("clip_action", "clip_subject"))
    sequences = []
    for name, start, length, action, subject in zip(names, starts, lengths, actions, subjects, strict=True):
        rows = slice(start, start + length, step)
        sequences.append(
            MocapSequence(
                name=str(name),
                fps=float(arrays["fps"]) / step,
                R_world_root=R_ZUP_YUP @ R[rows],
                body_pose=arrays["poses"][rows, 3:].astype(np.float64).reshape(-1, NUM_JOINTS - 1, 3),
                pelvis=arrays["trans"][rows].astype(np.float64) @ R_ZUP_YUP.T,
                contacts=arrays["contacts"][rows].astype(np.float64),
                leg_m=leg_m,
                action=str(action),
                subject=str(subject),
            )
        )
    return tuple(sequences)


def resample(sequence: MocapSequence, start_s: float, num_frames: int, fps: float) -> MocapSequence:
    """`num_frames` at another frame rate from `start_s` on; rotations are interpolated by slerp (Shoemake 1985)."""
    at = np.clip((start_s + np.arange(num_frames) / fps) * sequence.fps, 0, sequence.num_frames - 1)
    before = np.minimum(at.astype(int), sequence.num_frames - 2)
    fraction = (at - before)[:, None]
    pose = np.stack([_slerp(sequence.body_pose[:, j], at) for j in range(NUM_JOINTS - 1)], axis=1)
    root = Slerp(np.arange(sequence.num_frames), Rotation.from_matrix(sequence.R_world_root))(at).as_matrix()
    pelvis = (1 - fraction) * sequence.pelvis[before] + fraction * sequence.pelvis[before + 1]
    contacts = sequence.contacts[np.rint(at).astype(int)]
    return replace(sequence, fps=fps, R_world_root=root, body_pose=pose, pelvis=pelvis, contacts=contacts)


def _slerp(vectors: Float[Array, "N 3"], at: Float[Array, " n"]) -> Float[Array, "n 3"]:
    return np.asarray(Slerp(np.arange(len(vectors)), Rotation.from_rotvec(vectors))(at).as_rotvec())


def leg_length(rest_joints: Float[Array, "24 3"]) -> float:
    """Thigh and shank of a rest skeleton in SMPL's joint order, mean of both sides, metres."""
    thigh = np.linalg.norm(rest_joints[[4, 5]] - rest_joints[[1, 2]], axis=-1)
    shank = np.linalg.norm(rest_joints[[7, 8]] - rest_joints[[4, 5]], axis=-1)
    return float((thigh + shank).mean())


def random_shape(body: Body, rng: np.random.Generator) -> Float[Array, " 10"]:
    """Shape components of a random adult."""
    while True:
        betas = np.clip(rng.normal(0.0, SHAPE_DEVIATION, body.num_betas), -2.0, 2.0)
        if SHORTEST_M <= float(np.ptp(body.rest_vertices(betas)[:, 1])) <= TALLEST_M:
            return np.asarray(betas)


def pose_actor(sequence: MocapSequence, rng: np.random.Generator, *, betas: Float[Array, " 10"] | None = None) -> Actor:
    """The sequence on a body of this shape (None: a random adult's), standing on the floor z = 0."""
    body = load_body()
    betas = random_shape(body, rng) if betas is None else betas
    rest = body.rest_joints(betas)
    pelvis = sequence.pelvis * (leg_length(rest) / sequence.leg_m)
    joints, R = forward_kinematics(rest, sequence.R_world_root, sequence.body_pose, pelvis)
    soles = joints[:, list(CONTACT_JOINTS), 2] - sole_heights(body, betas)
    standing = soles[sequence.contacts > 0.5]
    floor = np.median(standing) if len(standing) else soles.min()
    joints[..., 2] -= floor
    return Actor(betas, sequence.R_world_root, sequence.body_pose, joints, R, sequence.contacts)
