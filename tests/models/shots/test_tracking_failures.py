"""Tracking failures: short runs of poses that fit nothing around them."""

from dataclasses import replace

import numpy as np
import pytest
from walking import camera, observed, sighting, walker

from humanmm.models.records.landmarks import SWAP
from humanmm.models.shots.left_right_swaps import SidesSeen
from humanmm.models.shots.tracking_failures import failed_frames

NUM_WALK = 60


def walk() -> SidesSeen:
    points = walker(NUM_WALK)
    return sighting(observed(points, *camera(20.0, points[NUM_WALK // 2, 23]), np.arange(NUM_WALK)))


def mixed(s: SidesSeen, frames: slice) -> SidesSeen:
    """The body turned by 70° with the legs' labels swapped: no choice of sides makes it fit."""
    keypoints, landmarks = s.keypoints2d.copy(), s.landmarks3d.copy()
    legs = np.arange(23, 33)
    for points in (keypoints, landmarks):
        points[frames, 23:] = points[frames][:, SWAP[legs]]
    c, s70 = np.cos(np.radians(70)), np.sin(np.radians(70))
    landmarks[frames] = landmarks[frames] @ np.array([[c, 0, s70], [0, 1, 0], [-s70, 0, c]])
    middle = keypoints[frames, 23:25, :1].mean(axis=1, keepdims=True)
    keypoints[frames, :, :1] = middle - 1.5 * (keypoints[frames, :, :1] - middle)
    return replace(s, keypoints2d=keypoints, landmarks3d=landmarks)


def test_tracking_does_not_fail_on_a_walk() -> None:
    assert not failed_frames(walk()).any()


@pytest.mark.parametrize("frames", [slice(20, 21), slice(20, 29), slice(0, 3), slice(NUM_WALK - 3, NUM_WALK)])
def test_a_few_mixed_up_poses_are_a_tracking_failure(frames: slice) -> None:
    expected = np.zeros(NUM_WALK, bool)
    expected[frames] = True
    np.testing.assert_array_equal(failed_frames(mixed(walk(), frames)), expected)


def test_many_mixed_up_poses_are_none_because_either_pose_may_be_the_right_one() -> None:
    assert not failed_frames(mixed(walk(), slice(15, 40))).any()


def test_swapped_sides_are_no_tracking_failure() -> None:
    s = walk()
    keypoints, landmarks = s.keypoints2d.copy(), s.landmarks3d.copy()
    for points in (keypoints, landmarks):
        points[20:28] = points[20:28][:, SWAP]
    assert not failed_frames(replace(s, keypoints2d=keypoints, landmarks3d=landmarks)).any()


def test_what_lies_on_either_side_of_a_hole_is_not_compared() -> None:
    s = walk()
    after = s.time_s >= s.time_s[30]
    apart = replace(s, time_s=s.time_s + np.where(after, 1.0, 0.0))
    assert not failed_frames(mixed(apart, slice(30, 33))).any()
