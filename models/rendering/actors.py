"""The actors of a clip: sequences at the clip's frame rate, on bodies of their own, placed beside each other."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from humanmm.models.body.body24 import load_body
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.refine.refine import sole_heights
from humanmm.models.records.recording import CONTACT_JOINTS
from humanmm.models.synthetic.mocap import Actor, MocapSequence, pose_actor

Array = np.ndarray

NEAREST_M, FARTHEST_M = 0.75, 2.2
"""Between pelvises: nobody walks through somebody else, and people stay near enough to share a picture."""
CONTACT_SPEED_MS, CONTACT_HEIGHT_M = 0.25, 0.05
"""A foot joint touches the floor if it is slower than this and its sole no higher above the floor."""


def place_actors(sequences: Sequence[MocapSequence], rng: np.random.Generator) -> list[Actor]:
    """One actor for each sequence; the first stays where it is, others are placed near it, clear of each other.

    A sequence for which no free position is found is left out.
    """
    actors = [with_contacts(pose_actor(sequences[0], rng), sequences[0].fps)]
    for sequence in sequences[1:]:
        other = with_contacts(pose_actor(sequence, rng), sequence.fps)
        for _ in range(300):
            moved = _moved(other, rng.uniform(0, 2 * np.pi), actors[0], rng)
            gaps = [np.linalg.norm((moved.joints - one.joints)[:, 0, :2], axis=1) for one in actors]
            if min(gap.min() for gap in gaps) > NEAREST_M and gaps[0].mean() < FARTHEST_M:
                actors.append(moved)
                break
    return actors


def with_contacts(actor: Actor, fps: float) -> Actor:
    """The actor with floor contacts computed from its own feet: the pack's belong to another body."""
    feet = actor.joints[:, list(CONTACT_JOINTS)]
    speed = np.linalg.norm(np.gradient(feet, axis=0), axis=-1) * fps
    heights = feet[..., 2] - sole_heights(load_body(), actor.betas)
    contacts = ((speed < CONTACT_SPEED_MS) & (heights < CONTACT_HEIGHT_M)).astype(np.float64)
    return replace(actor, contacts=contacts)


def _moved(actor: Actor, yaw: float, beside: Actor, rng: np.random.Generator) -> Actor:
    """The actor rotated about the vertical, its path's middle near that of `beside`."""
    R = rotvec_to_rotmat(np.array([0.0, 0.0, yaw]))
    away = rng.uniform(0, 2 * np.pi)
    target = beside.joints[:, 0].mean(axis=0) + rng.uniform(0.6, 1.8) * np.array([np.cos(away), np.sin(away), 0])
    joints = actor.joints @ R.T
    shift = (target - joints[:, 0].mean(axis=0)) * [1, 1, 0]
    return replace(
        actor, R_world_root=R @ actor.R_world_root, joints=joints + shift, R_world_joint=R @ actor.R_world_joint
    )


def shifted(actor: Actor, shift: Float[Array, "3"]) -> Actor:
    """The actor moved by `shift`, metres."""
    return replace(actor, joints=actor.joints + shift)
