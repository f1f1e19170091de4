"""People of whom a detector gives COCO's 17 keypoints alone."""

from pathlib import Path

import numpy as np

from humanmm.models.perception.lifting.features import view_axes
from humanmm.models.perception.lifting.lift import lift
from humanmm.models.perception.tracking.coco import coco_track
from humanmm.models.records.landmarks import COCO_LANDMARKS, SWAP
from humanmm.models.records.tracks import MASK_SIDE, PersonTrack
from humanmm.storage.readers.aist import read_aist_sequence

SEQUENCE = read_aist_sequence(Path(__file__).parents[4] / "examples" / "aist" / "gBR_sBM_cAll_d06_mBR2_ch06.npz")
N = 30
TIME_S = np.arange(N) / 30
K = SEQUENCE.K[0]
COCO_MIRROR = [0, 2, 1, 4, 3, 6, 5, 8, 7, 10, 9, 12, 11, 14, 13, 16, 15]


def _track(keypoints: np.ndarray) -> PersonTrack:
    return coco_track(np.arange(N), keypoints, time_s=TIME_S, K=K, size=SEQUENCE.size, lifter=lift)


def _landmarks_cam(track: PersonTrack, K: np.ndarray) -> np.ndarray:
    centre = track.mask_affine.astype(np.float64) @ np.array([MASK_SIDE / 2, MASK_SIDE / 2, 1.0])
    return np.asarray(track.landmarks3d @ np.swapaxes(view_axes(centre, K), -1, -2))


def test_lifted_poses_are_near_the_true_ones() -> None:
    for camera in range(0, 9, 2):
        K = SEQUENCE.K[camera]
        track = coco_track(
            np.arange(N), SEQUENCE.keypoints[camera, :N], time_s=TIME_S, K=K, size=SEQUENCE.size, lifter=lift
        )
        found = _landmarks_cam(track, K)[:, list(COCO_LANDMARKS)]
        true = (SEQUENCE.joints[:N] - SEQUENCE.t_world_cam[camera]) @ SEQUENCE.R_world_cam[camera]
        true = true - true[:, [11, 12]].mean(axis=1, keepdims=True)
        scale = np.linalg.norm(true) / np.linalg.norm(found)
        assert np.linalg.norm(scale * found - true, axis=-1)[:, 5:].mean() < 0.15


def test_a_mirrored_picture_gives_nearly_the_mirrored_pose() -> None:
    keypoints = SEQUENCE.keypoints[0, :N]
    mirrored = keypoints[:, COCO_MIRROR].copy()
    mirrored[..., 0] = SEQUENCE.size[0] - mirrored[..., 0]
    one, other = _track(keypoints).landmarks3d, _track(mirrored).landmarks3d[:, SWAP] * [-1, 1, 1]
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
