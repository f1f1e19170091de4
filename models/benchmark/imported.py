"""Other systems' results as sequences: SMPL parameters in their own world, put on body24's average person, z up.

SMPL's mesh is not here, so that joints come from body24's skeleton: rotations and path are theirs, bone lengths those
of an average person. Errors after a similarity (PA, WA) do not feel it; W and RTE feel it by a few per cent.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from humanmm.models.body.body24 import JOINT_NAMES, load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.geometry.rotations import swing
from humanmm.models.records.sequence import MotionSequence, PersonSequence

Array = np.ndarray

NUM_JOINTS = 23
"""Body joints of SMPL; systems that end at the wrists leave the last two at rest."""
SMPL_REST_PELVIS = np.array([-0.0018, -0.2233, 0.0282])
"""Pelvis joint of SMPL's neutral template about its origin, metres, as published with the model."""


@dataclass(frozen=True)
class SmplMotion:
    """One person in a world of the system's own, N frames."""

    frame: Int[Array, " N"]
    global_orient: Float[Array, "N 3 3"]
    body_pose: Float[Array, "N J 3"]
    """Axis-angle, the first J of SMPL's 23 body joints."""
    transl: Float[Array, "N 3"]
    """SMPL's transl, metres."""


def imported_sequence(
    motion: SmplMotion, *, up: Float[Array, "3"], num_frames: int, fps: float, notes: tuple[str, ...] = ()
) -> MotionSequence:
    """The motion in a world whose z is `up` (a direction in the system's own world)."""
    R_world_theirs = swing(up / np.linalg.norm(up), np.array([0.0, 0.0, 1.0]))
    R_root = R_world_theirs @ motion.global_orient
    pose = np.zeros((len(motion.frame), NUM_JOINTS, 3))
    given = motion.body_pose[:, :NUM_JOINTS]
    pose[:, : given.shape[1]] = given
    pelvis = (motion.transl + SMPL_REST_PELVIS) @ R_world_theirs.T
    joints, _ = forward_kinematics(load_body().J_template, R_root, pose, pelvis)
    person = PersonSequence(
        person=0,
        frame=motion.frame.astype(np.int64),
        observed=np.ones(len(motion.frame), bool),
        joints=joints,
        R_world_root=R_root,
    )
    return MotionSequence(num_frames, fps, JOINT_NAMES, (person,), (), notes=notes)
