"""A small synthetic sequence: one body24 person who wanders and turns, seen by a camera that orbits and cuts once."""

import numpy as np
import pytest
from standing_person import changed, standing

from humanmm.models.body.body24 import JOINT_NAMES, load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.evaluation.orientation import R_WORLD_UPRIGHT
from humanmm.models.evaluation.people import projected_boxes
from humanmm.models.geometry.alignment import yaw_to_rotmat
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.records.sequence import BodyParameters, CameraSequence, MotionSequence, PersonSequence

__all__ = ["changed", "standing"]

NUM_FRAMES = 130
CUT = 60


@pytest.fixture(scope="session")
def sequence() -> MotionSequence:
    time = np.arange(NUM_FRAMES) / 30.0
    phase = np.random.default_rng(0).uniform(0, 2 * np.pi, (23, 3))
    body_pose = 0.3 * np.sin(2.0 * time[:, None, None] + phase)
    R_root = np.stack([yaw_to_rotmat(0.8 * t) @ R_WORLD_UPRIGHT for t in time])
    pelvis = np.stack([0.9 * time, 0.5 * np.sin(time), 0.95 + 0.03 * np.sin(6 * time)], axis=1)
    betas = np.linspace(-0.5, 0.5, 10)
    body = load_body()
    joints, _ = forward_kinematics(body.rest_joints(betas), R_root, body_pose, pelvis)
    cameras = _cameras(time)
    frame = np.arange(NUM_FRAMES)
    person = PersonSequence(
        person=0,
        frame=frame,
        observed=np.ones(NUM_FRAMES, bool),
        joints=joints,
        R_world_root=R_root,
        contacts=np.tile([1.0, 1.0, 0.0, 0.0], (NUM_FRAMES, 1)),
        bbox_xyxy=projected_boxes(joints, frame, cameras),
        body=BodyParameters("body24", rotmat_to_rotvec(R_root), body_pose, betas, pelvis - body.rest_joints(betas)[0]),
    )
    return MotionSequence(NUM_FRAMES, 30.0, JOINT_NAMES, (person,), ((CUT, CUT),), cameras)


def _cameras(time: np.ndarray) -> CameraSequence:
    """Five metres from the person's middle, orbiting slowly; after the cut from 100° further round."""
    angle = 0.2 * time + np.where(np.arange(len(time)) >= CUT, np.radians(100), 0.0)
    R_world_level = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # looks along the world's +y
    R = np.stack([yaw_to_rotmat(a) @ rotvec_to_rotmat([0.0, 0.0, 0.02]) @ R_world_level for a in angle])
    t = np.array([1.5, 0.0, 1.4]) - 5.0 * R[:, :, 2]
    K = np.tile(np.array([[1000.0, 0.0, 480.0], [0.0, 1000.0, 270.0], [0.0, 0.0, 1.0]]), (len(time), 1, 1))
    return CameraSequence(R, t, K)
