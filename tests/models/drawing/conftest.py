"""Truth of the rendered clips as recordings: what a perfect result would hand to the pictures."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.records.recording import RecordedPerson, Recording

R_WORLD_BODY = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""An upright body that faces −y: body y (up) is world z."""


@pytest.fixture(scope="session")
def standing() -> Recording:
    """40 frames of one person in T-pose 4 m in front of a level camera; a cut at 20; not observed from 30 on."""
    num_frames = 40
    body = load_body()
    betas = np.zeros(10)
    rest = body.rest_joints(betas)
    pelvis = np.tile([0.0, 0.0, 0.95], (num_frames, 1))
    pelvis[:, 0] = np.linspace(-0.3, 0.3, num_frames)
    R = np.tile(R_WORLD_BODY, (num_frames, 1, 1))
    joints, _ = forward_kinematics(rest, R, np.zeros((num_frames, 23, 3)), pelvis)
    frame = np.arange(num_frames, dtype=np.int32)
    person = RecordedPerson(
        person=0,
        frame=frame,
        observed=frame < 30,
        root_orient=np.tile(np.float32([np.pi / 2, 0, 0]), (num_frames, 1)),
        body_pose=np.zeros((num_frames, 23, 3), np.float32),
        betas=betas.astype(np.float32),
        transl=(pelvis - rest[0]).astype(np.float32),
        joints=joints.astype(np.float32),
        contacts=np.ones((num_frames, 4), np.float32),
        keypoints2d=np.zeros((num_frames, 33, 3), np.float32),
        bbox=np.zeros((num_frames, 4), np.float32),
        confidence=np.ones(num_frames, np.float32),
    )
    return Recording(
        width=640,
        height=480,
        time_s=np.arange(num_frames) / 30,
        shot_index=(frame >= 20).astype(np.int32),
        cut_frames=(20,),
        R_world_cam=np.tile(np.float32([[1, 0, 0], [0, 0, 1], [0, -1, 0]]), (num_frames, 1, 1)),
        t_world_cam=np.tile(np.float32([0, -4, 1]), (num_frames, 1)),
        K=np.tile(np.float32([[600, 0, 320], [0, 600, 240], [0, 0, 1]]), (num_frames, 1, 1)),
        camera_source=np.zeros(num_frames, np.uint8),
        people=(person,),
    )


@pytest.fixture(scope="session")
def rendered() -> Callable[[str], tuple[Recording, list[np.ndarray]]]:
    """Recording and packed silhouettes of one rendered clip, by name."""
    root = os.environ.get("HUMANMM_DATA")
    if not root:
        pytest.skip("HUMANMM_DATA is not set: the rendered clips are not here")
    folder = Path(root) / "render_dev"

    def read(name: str) -> tuple[Recording, list[np.ndarray]]:
        with np.load(folder / f"{name}_gt.npz") as truth:
            numbers = sorted({key.split("/")[1] for key in truth.files if key.startswith("people/")})
            K = truth["cameras/K"].astype(np.float32)
            K[:, :2, 2] += 0.5  # these files have pixel centres at integers
            num_frames = int(truth["num_frames"])
            absent = ("person", "keypoints2d", "probability", "hand_pose", "hand_confidence")
            fields = [f for f in RecordedPerson.__dataclass_fields__ if f not in absent]
            people = tuple(
                RecordedPerson(
                    person=int(n),
                    keypoints2d=np.zeros((num_frames, 33, 3), np.float32),
                    **{field: truth[f"people/{n}/{field}"] for field in fields},
                )
                for n in numbers
            )
            recording = Recording(
                width=int(truth["width"]),
                height=int(truth["height"]),
                time_s=truth["time_s"],
                shot_index=truth["shot_index"],
                cut_frames=tuple(int(c) for c in truth["cut_frames"]),
                R_world_cam=truth["cameras/R_world_cam"].astype(np.float32),
                t_world_cam=truth["cameras/t_world_cam"].astype(np.float32),
                K=K,
                camera_source=np.zeros(num_frames, np.uint8),
                people=people,
            )
        with np.load(folder / f"{name}_masks.npz") as masks:
            return recording, [masks[f"people/{n}/mask"] for n in numbers]

    return read
