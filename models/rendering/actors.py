"""The people of a clip: sequences at the clip's frame rate, on bodies of their own, put beside each other."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation, Slerp

from humanmm.models.body.body24 import NUM_JOINTS, load_body
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.refine.refine import sole_heights
from humanmm.models.records.recording import CONTACT_JOINTS
from humanmm.models.synthetic.mocap import Actor, MocapSequence, cast

Array = np.ndarray

NEAREST_M, FARTHEST_M = 0.75, 2.2
"""Between pelvises: nobody walks through somebody else, and people stay near enough to share a picture."""
STANDING_MS, STANDING_M = 0.25, 0.05
"""A place of the foot stands if it is slower and its sole no higher above the floor than this."""


def resample(sequence: MocapSequence, start_s: float, num_frames: int, fps: float) -> MocapSequence:
    """`num_frames` at another frame rate from `start_s` on; rotations go along great circles."""
    at = np.clip((start_s + np.arange(num_frames) / fps) * sequence.fps, 0, sequence.num_frames - 1)
    before = np.minimum(at.astype(int), sequence.num_frames - 2)
    share = (at - before)[:, None]
    pose = np.stack([_turn_between(sequence.body_pose[:, j], at) for j in range(NUM_JOINTS - 1)], axis=1)
    root = Slerp(np.arange(sequence.num_frames), Rotation.from_matrix(sequence.R_world_root))(at).as_matrix()
    pelvis = (1 - share) * sequence.pelvis[before] + share * sequence.pelvis[before + 1]
    contacts = sequence.contacts[np.rint(at).astype(int)]
    return MocapSequence(sequence.name, fps, root, pose, pelvis, contacts, sequence.leg_m)


def _turn_between(vectors: Float[Array, "N 3"], at: Float[Array, " n"]) -> Float[Array, "n 3"]:
    return np.asarray(Slerp(np.arange(len(vectors)), Rotation.from_rotvec(vectors))(at).as_rotvec())


def cast_people(sequences: Sequence[MocapSequence], rng: np.random.Generator) -> list[Actor]:
    """One actor for each sequence; the first stays where it is, others are put near, out of everybody's path.

    Somebody for whom no place is found is left out.
    """
    actors = [standing(cast(sequences[0], rng), sequences[0].fps)]
    for sequence in sequences[1:]:
        other = standing(cast(sequence, rng), sequence.fps)
        for _ in range(300):
            moved = _moved(other, rng.uniform(0, 2 * np.pi), actors[0], rng)
            gaps = [np.linalg.norm((moved.joints - one.joints)[:, 0, :2], axis=1) for one in actors]
            if min(gap.min() for gap in gaps) > NEAREST_M and gaps[0].mean() < FARTHEST_M:
                actors.append(moved)
                break
    return actors


def standing(actor: Actor, fps: float) -> Actor:
    """The actor with contacts of this body: the pack's were made for another."""
    feet = actor.joints[:, list(CONTACT_JOINTS)]
    speed = np.linalg.norm(np.gradient(feet, axis=0), axis=-1) * fps
    heights = feet[..., 2] - sole_heights(load_body(), actor.betas)
    contacts = ((speed < STANDING_MS) & (heights < STANDING_M)).astype(np.float64)
    return Actor(actor.betas, actor.R_world_root, actor.body_pose, actor.joints, actor.R_world_joint, contacts)


def _moved(actor: Actor, yaw: float, beside: Actor, rng: np.random.Generator) -> Actor:
    """The actor turned about the vertical, its path's middle near that of somebody else."""
    R = rotvec_to_rotmat(np.array([0.0, 0.0, yaw]))
    away = rng.uniform(0, 2 * np.pi)
    target = beside.joints[:, 0].mean(axis=0) + rng.uniform(0.6, 1.8) * np.array([np.cos(away), np.sin(away), 0])
    turned = actor.joints @ R.T
    shift = (target - turned[:, 0].mean(axis=0)) * [1, 1, 0]
    return Actor(
        actor.betas, R @ actor.R_world_root, actor.body_pose, turned + shift, R @ actor.R_world_joint, actor.contacts
    )


def shifted(actor: Actor, shift: Float[Array, "3"]) -> Actor:
    """The actor somewhere else."""
    return Actor(
        actor.betas, actor.R_world_root, actor.body_pose, actor.joints + shift, actor.R_world_joint, actor.contacts
    )
