"""A recording of one body that stands four metres in front of a level camera and looks at it, with exact keypoints."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.evaluation.overlay import in_picture, landmarks_in_world
from humanmm.models.geometry.rotations import rotmat_to_rotvec
from humanmm.models.records.recording import RecordedPerson, Recording

NUM_FRAMES = 30
WIDTH, HEIGHT = 640, 480
FOCAL_PX = 600.0
R_WORLD_CAM = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
"""A level camera that looks along +y."""
R_TOWARDS = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""A body (y up, facing +z) that stands upright and faces −y: the camera."""


def standing_person(number: int = 0, *, x: float = 0.0, R_world_root: np.ndarray = R_TOWARDS) -> RecordedPerson:
    """A body four metres in front of the camera, so far to its right; without keypoints."""
    body, betas = load_body(), np.zeros(10)
    rest = body.rest_joints(betas)
    sole_m = float(-body.rest_vertices(betas)[:, 1].min() + rest[0, 1])
    pelvis = np.tile([x, 4.0, sole_m], (NUM_FRAMES, 1))
    R_root = np.tile(R_world_root, (NUM_FRAMES, 1, 1))
    pose = np.zeros((NUM_FRAMES, 23, 3), np.float32)
    joints, _ = forward_kinematics(rest, R_root, pose, pelvis)
    return RecordedPerson(
        person=number,
        frame=np.arange(NUM_FRAMES, dtype=np.int32),
        observed=np.ones(NUM_FRAMES, bool),
        root_orient=rotmat_to_rotvec(R_root).astype(np.float32),
        body_pose=pose,
        betas=betas.astype(np.float32),
        transl=(pelvis - rest[0]).astype(np.float32),
        joints=joints.astype(np.float32),
        contacts=np.ones((NUM_FRAMES, 4), np.float32),
        keypoints2d=np.zeros((NUM_FRAMES, 33, 3), np.float32),
        bbox=np.zeros((NUM_FRAMES, 4), np.float32),
        confidence=np.ones(NUM_FRAMES, np.float32),
    )


def recording_of(*people: RecordedPerson, cut_frames: tuple[int, ...] = ()) -> Recording:
    """These people before one static camera 1.2 m above the floor."""
    frames = np.arange(NUM_FRAMES)
    K = np.array([[FOCAL_PX, 0, WIDTH / 2], [0, FOCAL_PX, HEIGHT / 2], [0, 0, 1]])
    return Recording(
        width=WIDTH,
        height=HEIGHT,
        time_s=frames / 30.0,
        shot_index=np.searchsorted(cut_frames, frames, side="right").astype(np.int32),
        cut_frames=cut_frames,
        R_world_cam=np.tile(R_WORLD_CAM, (NUM_FRAMES, 1, 1)).astype(np.float32),
        t_world_cam=np.tile([0.0, 0.0, 1.2], (NUM_FRAMES, 1)).astype(np.float32),
        K=np.tile(K, (NUM_FRAMES, 1, 1)).astype(np.float32),
        camera_source=np.zeros(NUM_FRAMES, np.uint8),
        people=people,
    )


@pytest.fixture(scope="session")
def standing() -> Recording:
    """One body whose keypoints are exactly where its landmarks are."""
    recording = recording_of(standing_person())
    (person,) = recording.people
    pixels, _ = in_picture(landmarks_in_world(person), person, recording)
    keypoints = np.concatenate([pixels, np.ones((NUM_FRAMES, 33, 1))], axis=2).astype(np.float32)
    return replace(recording, people=(replace(person, keypoints2d=keypoints),))


@pytest.fixture
def changed(standing: Recording) -> Callable[..., Recording]:
    """Makes the recording with other arrays of its person."""

    def change(**arrays: np.ndarray) -> Recording:
        return replace(standing, people=(replace(standing.people[0], **arrays),))

    return change
