"""A small recording for tests of writers: two people and a cut, every field filled with numbers of its own."""

import numpy as np
import pytest

from humanmm.models.motion.recording import RecordedPerson, Recording


@pytest.fixture
def recording() -> Recording:
    """12 frames at a variable rate, a cut in the middle; person 1 enters two frames late."""
    num_frames = 12
    rng = np.random.default_rng(7)
    cut = num_frames // 2

    def person(number: int) -> RecordedPerson:
        frame = np.arange(2 * number, num_frames, dtype=np.int32)
        n = len(frame)
        joints = rng.normal(size=(n, 24, 3)).astype(np.float32)
        observed = np.ones(n, bool)
        observed[cut - 2 * number] = False
        return RecordedPerson(
            person=number,
            frame=frame,
            observed=observed,
            root_orient=rng.normal(size=(n, 3)).astype(np.float32),
            body_pose=rng.normal(size=(n, 23, 3)).astype(np.float32),
            betas=rng.normal(size=10).astype(np.float32),
            transl=rng.normal(size=(n, 3)).astype(np.float32),
            joints=joints,
            contacts=rng.uniform(size=(n, 4)).astype(np.float32),
            keypoints2d=rng.uniform(size=(n, 33, 3)).astype(np.float32),
            bbox=rng.uniform(size=(n, 4)).astype(np.float32),
            confidence=rng.uniform(size=n).astype(np.float32),
        )

    return Recording(
        width=640,
        height=360,
        time_s=np.cumsum(rng.uniform(0.02, 0.05, num_frames)),
        shot_index=(np.arange(num_frames) >= cut).astype(np.int32),
        cut_frames=(cut,),
        R_world_cam=np.tile(np.eye(3, dtype=np.float32), (num_frames, 1, 1)),
        t_world_cam=np.zeros((num_frames, 3), np.float32),
        K=np.tile(np.array([[500, 0, 320], [0, 500, 180], [0, 0, 1]], np.float32), (num_frames, 1, 1)),
        camera_source=np.full(num_frames, 4, np.uint8),
        people=tuple(person(number) for number in range(2)),
    )
