"""AMASS's SMPL-X dialect: what the Blender SMPL-X add-on and GMR read. z up, metres, axis-angle, float64."""

from pathlib import Path

import numpy as np

from humanmm.models.motion.recording import RecordedPerson, Recording

SMPLX_REST_PELVIS = np.array([0.00312326, -0.35140747, 0.01203655])
"""Pelvis joint of the neutral SMPL-X body with zero betas, metres: a reader adds it to `trans`."""

NUM_BETAS = 16
BODY_JOINTS = 21
"""SMPL-X ends the body at the wrists; SMPL's two hand joints (22, 23) have no counterpart."""


def write_amass(recording: Recording, person: RecordedPerson, path: Path) -> None:
    """One person as npz. `betas` are zero unless the body is SMPL; ours stand beside them, in their own basis."""
    num_frames = len(person.frame)
    root_orient = person.root_orient.astype(np.float64)
    pose_body = person.body_pose[:, :BODY_JOINTS].reshape(num_frames, -1).astype(np.float64)
    pose_jaw, pose_eye, pose_hand = (np.broadcast_to(0.0, (num_frames, width)) for width in (3, 6, 90))
    np.savez(
        path,
        allow_pickle=False,
        gender=np.array("neutral"),
        surface_model_type=np.array("smplx"),
        mocap_frame_rate=np.array(recording.fps, np.float64),
        betas=np.zeros(NUM_BETAS),
        num_betas=np.array(NUM_BETAS),
        trans=person.pelvis.astype(np.float64) - SMPLX_REST_PELVIS,
        poses=np.concatenate([root_orient, pose_body, pose_jaw, pose_eye, pose_hand], axis=1),
        root_orient=root_orient,
        pose_body=pose_body,
        pose_jaw=pose_jaw,
        pose_eye=pose_eye,
        pose_hand=pose_hand,
        betas_body24=person.betas.astype(np.float64),
    )
