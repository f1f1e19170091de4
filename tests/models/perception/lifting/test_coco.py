"""People of whom a detector gives COCO's 17 keypoints alone."""

from pathlib import Path

import numpy as np
import pytest

from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.perception.lifting import keypoints as lifting
from humanmm.models.perception.lifting import reading
from humanmm.models.perception.lifting.coco import coco_track
from humanmm.models.perception.lifting.keypoints import keypoint_input, lift_keypoints, views_of
from humanmm.models.perception.lifting.reading import Reading
from humanmm.models.records.landmarks import COCO_LANDMARKS, SWAP
from humanmm.models.records.tracks import PersonTrack, PoseEstimates
from humanmm.storage.readers.aist import read_aist_sequence

SEQUENCE = read_aist_sequence(Path(__file__).parents[4] / "examples" / "aist" / "gBR_sBM_cAll_d06_mBR2_ch06.npz")
N = 30
TIME_S = np.arange(N) / 30
K = SEQUENCE.K[0]
COCO_MIRROR = [0, 2, 1, 4, 3, 6, 5, 8, 7, 10, 9, 12, 11, 14, 13, 16, 15]


def _track(keypoints: np.ndarray) -> PersonTrack:
    return coco_track(np.arange(N), keypoints, time_s=TIME_S, K=K, size=SEQUENCE.size, lifter=lift_keypoints)


def test_lifted_poses_are_near_the_true_ones() -> None:
    for camera in range(0, 9, 2):
        found = lift_keypoints(SEQUENCE.keypoints[camera, :N], TIME_S, SEQUENCE.K[camera]).landmarks3d[
            :, list(COCO_LANDMARKS)
        ]
        true = (SEQUENCE.joints[:N] - SEQUENCE.t_world_cam[camera]) @ SEQUENCE.R_world_cam[camera]
        true = true - true[:, [11, 12]].mean(axis=1, keepdims=True)
        scale = np.linalg.norm(true) / np.linalg.norm(found)
        assert np.linalg.norm(scale * found - true, axis=-1)[:, 5:].mean() < 0.15


def test_lifting_depends_neither_on_place_in_the_picture_nor_on_size() -> None:
    given = keypoint_input(SEQUENCE.keypoints[0, :N], TIME_S, K, *views_of(SEQUENCE.keypoints[0, :N], K))
    smaller = SEQUENCE.keypoints[0, :N].copy()
    smaller[..., :2] = 0.5 * (smaller[..., :2] - K[:2, 2]) + K[:2, 2]
    far = keypoint_input(smaller, TIME_S, K, *views_of(smaller, K))
    # The turn to the torso's ray bends a picture by what the body's angle is: small for a small body.
    assert (given.points - far.points).abs().max() < 0.05
    assert (far.size / given.size - 0.5).abs().max() < 0.03


def test_a_long_track_is_lifted_in_pieces_as_if_it_were_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    keypoints, time_s = np.tile(SEQUENCE.keypoints[0, :240], (2, 1, 1)), np.arange(480) / 30
    parts = lift_keypoints(keypoints, time_s, K).landmarks3d
    monkeypatch.setattr(reading, "CHUNK_S", 1000.0)
    assert np.abs(parts - lift_keypoints(keypoints, time_s, K).landmarks3d).max() < 1e-5


def test_swapped_sides_are_put_right_for_a_second_look_and_named_as_given(monkeypatch: pytest.MonkeyPatch) -> None:
    keypoints, are_swapped = SEQUENCE.keypoints[0, :N].copy(), np.arange(N) >= 20
    keypoints[..., 2] = 1.0
    shown: list[np.ndarray] = []

    def see(_: object, given: np.ndarray, *__: object) -> Reading:
        shown.append(given)
        pose = PoseEstimates(np.zeros((N, 20, 3)), np.ones((N, 20)), np.where(are_swapped, 2.0, -2.0))
        return Reading(np.tile(np.arange(33.0)[:, None], (N, 1, 3)) + len(shown), pose)

    monkeypatch.setattr(lifting, "_seen_by", see)
    found = lift_keypoints(keypoints, TIME_S, K)
    first, second = shown
    np.testing.assert_array_equal(first, keypoints)
    np.testing.assert_array_equal(second[:20], keypoints[:20])
    np.testing.assert_array_equal(second[20:], keypoints[20:, COCO_MIRROR])
    np.testing.assert_array_equal(found.landmarks3d[:20, :, 0], np.tile(np.arange(33) + 2, (20, 1)))
    np.testing.assert_array_equal(found.landmarks3d[20:, :, 0], np.tile(SWAP + 2, (10, 1)))
    assert found.pose is not None and (found.pose.swap_odds[20:] == 2.0).all()


def test_a_mirrored_picture_gives_nearly_the_mirrored_pose() -> None:
    keypoints = SEQUENCE.keypoints[0, :N]
    mirrored = keypoints[:, COCO_MIRROR].copy()
    mirrored[..., 0] = SEQUENCE.size[0] - mirrored[..., 0]
    one = lift_keypoints(keypoints, TIME_S, K).landmarks3d
    other = lift_keypoints(mirrored, TIME_S, K).landmarks3d[:, SWAP] * [-1, 1, 1]
    assert np.linalg.norm(one - other, axis=-1).mean() < 0.06


def test_unseen_keypoints_are_filled_without_becoming_evidence() -> None:
    keypoints = SEQUENCE.keypoints[0, :N].copy()
    keypoints[:, 9] = [5e4, -5e4, 0.01]  # a wrist far outside, with a score that says nothing
    track = _track(keypoints)
    wrist = COCO_LANDMARKS[9]
    assert np.all(track.keypoints2d[:, wrist, 2] == 0)
    elbow = track.keypoints2d[:, COCO_LANDMARKS[7], :2]
    assert np.all(np.linalg.norm(track.keypoints2d[:, wrist, :2] - elbow, axis=-1) < 200)
    others = np.setdiff1d(np.arange(33), COCO_LANDMARKS)
    assert np.all(track.keypoints2d[:, others, 2] == 0)
    assert np.isfinite(track.landmarks3d).all()
    assert (track.bbox[:, 2:] < 2000).all()


def test_frames_that_show_nobody_are_left_out() -> None:
    keypoints = SEQUENCE.keypoints[0, :N].copy()
    keypoints[10:13, :, 2] = 0
    assert np.array_equal(_track(keypoints).frame, np.r_[0:10, 13:N])


def test_the_root_is_turned_as_the_landmarks_are() -> None:
    track = _track(SEQUENCE.keypoints[2, :N])
    assert track.pose is not None
    R_root = rotvec_to_rotmat(track.pose.vectors[:, 0].astype(np.float64))
    left = track.landmarks3d[:, 23].astype(np.float64) - track.landmarks3d[:, 24]
    left /= np.linalg.norm(left, axis=-1, keepdims=True)
    assert (R_root[:, :, 0] * left).sum(axis=-1).mean() > 0.9
