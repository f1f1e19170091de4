"""Left and right along a track."""

import numpy as np

from humanmm.models.perception.tracking.sides import left_right_swaps, side_vote
from humanmm.models.records.landmarks import INDEX, NUM_LANDMARKS, SWAP


def walking_body(frames: int) -> tuple[np.ndarray, np.ndarray]:
    """Keypoints in pixels and 3D landmarks of a body seen from the front, swaying a little."""
    rng = np.random.default_rng(3)
    pose = rng.normal(0, 0.02, (NUM_LANDMARKS, 3))
    for joint, height, width in (("shoulder", -0.5, 0.18), ("elbow", -0.25, 0.3), ("wrist", 0.0, 0.35),
                                 ("hip", 0.0, 0.1), ("knee", 0.4, 0.12), ("ankle", 0.8, 0.12)):  # fmt: skip
        for side, sign in (("left", 1), ("right", -1)):
            pose[INDEX[f"{side}_{joint}"]] = [sign * width, height, 0.0]
    poses = pose + 0.01 * np.sin(np.arange(frames) / 5)[:, None, None] + rng.normal(0, 0.01, (frames, NUM_LANDMARKS, 3))
    keypoints = poses * 200 + 300
    keypoints[..., 2] = 1.0
    return keypoints, poses


def test_swap_is_its_own_inverse_and_keeps_the_nose() -> None:
    np.testing.assert_array_equal(SWAP[SWAP], np.arange(NUM_LANDMARKS))
    assert SWAP[INDEX["nose"]] == INDEX["nose"]


def test_runs_of_swapped_frames_are_found_from_continuity() -> None:
    keypoints, poses = walking_body(60)
    truth = np.zeros(60, bool)
    truth[20:33] = truth[40] = True
    keypoints[truth], poses[truth] = keypoints[truth][:, SWAP], poses[truth][:, SWAP]
    found = left_right_swaps(keypoints, poses, np.zeros(60), np.arange(60) / 30, np.full(60, 400.0))
    np.testing.assert_array_equal(found, truth)


def test_second_looks_decide_which_stretch_is_right() -> None:
    keypoints, poses = walking_body(60)
    swapped = np.arange(60) < 45
    keypoints[swapped], poses[swapped] = keypoints[swapped][:, SWAP], poses[swapped][:, SWAP]
    votes = np.zeros(60)
    votes[10], votes[50] = -2.0, 2.0
    found = left_right_swaps(keypoints, poses, votes, np.arange(60) / 30, np.full(60, 400.0))
    np.testing.assert_array_equal(found, swapped)


def test_a_side_vote_has_the_sign_of_the_agreement() -> None:
    keypoints, _ = walking_body(1)
    assert side_vote(keypoints[0], keypoints[0], 400) > 1
    assert side_vote(keypoints[0], keypoints[0][SWAP], 400) < -1
