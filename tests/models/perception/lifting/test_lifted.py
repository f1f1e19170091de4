"""Tracks as a lifter returns them."""

import numpy as np
import pytest

from humanmm.models.geometry.intrinsics import default_focal_px
from humanmm.models.perception.interfaces import Lifted, PersonFrames
from humanmm.models.perception.lifting.lifted import keep, lifted_people
from humanmm.models.records.tracks import MASK_SIDE, PersonTrack, PoseEstimates, ScenePeople, Silhouettes

N = 4


def people() -> ScenePeople:
    """One track in frames 2 to 5, its crop 64 pixels wide about (100, 50)."""
    scale = 64 / MASK_SIDE
    affine = np.tile(np.array([[scale, 0, 100 - 32], [0, scale, 50 - 32]], np.float32), (N, 1, 1))
    track = PersonTrack(
        frame=np.arange(2, 2 + N, dtype=np.int32), keypoints2d=np.ones((N, 33, 3), np.float32),
        landmarks3d=np.ones((N, 33, 3), np.float32), bbox=np.zeros((N, 4), np.float32),
        confidence=np.ones(N, np.float32), masks=Silhouettes.pack(np.zeros((N, MASK_SIDE, MASK_SIDE))),
        mask_affine=affine, color_frame=np.zeros(0, np.int32), color_histogram=np.zeros((0, 4), np.float32),
    )  # fmt: skip
    return ScenePeople(0, 8, (track,))


def test_a_lifter_is_shown_the_crop_and_its_result_becomes_the_track() -> None:
    pose = PoseEstimates(np.zeros((N, 20, 3)), np.ones((N, 20)), np.zeros(N))

    def lifter(frames: PersonFrames, K: np.ndarray) -> Lifted:
        assert frames.time_s.tolist() == [2.0, 3.0, 4.0, 5.0]
        np.testing.assert_allclose(frames.centre, [[100, 50]] * N)
        np.testing.assert_allclose(frames.side, 64)
        assert K[0, 0] == pytest.approx(default_focal_px(200, 100))
        return Lifted(2 * frames.landmarks3d, pose)

    (track,) = lifted_people(people(), lifter, np.arange(8.0), (200, 100)).tracks
    assert (track.landmarks3d == 2).all() and track.pose is pose


def test_without_a_lifter_landmarks_are_kept() -> None:
    (track,) = lifted_people(people(), keep, np.arange(8.0), (200, 100)).tracks
    assert (track.landmarks3d == 1).all() and track.pose is None


def test_a_pose_is_known_where_left_and_right_are_named_as_the_lifter_holds_them() -> None:
    pose = PoseEstimates(np.zeros((N, 20, 3)), np.full((N, 20), 0.2), np.array([-3.0, -3.0, 3.0, 3.0]))
    assert (pose.sigma_as_named.max(axis=1) > 3).tolist() == [False, False, True, True]
    swapped = pose.with_sides_swapped(np.array([True, False, False, True]))
    assert (swapped.sigma_as_named.max(axis=1) > 3).tolist() == [True, False, True, False]
    assert swapped.swap_odds.tolist() == [3.0, -3.0, 3.0, -3.0]
