"""Which shots are compared, how much of them, and how far such a rotation may be off."""

import numpy as np
import pytest

from humanmm.models.camera.background.frame_edges import ViewHypothesis
from humanmm.models.camera.background.keyframes import FrameFeatures
from humanmm.models.camera.background.shot_edges import COMPARE_ALL, QUICK_FEATURES, find_shot_edges, sigma_deg
from humanmm.models.geometry.intrinsics import K_from_focal
from humanmm.models.geometry.rotations import rotvec_to_rotmat

K = K_from_focal(800.0, 960, 540)


def seen(frame: int, *scenes: int, num_features: int = 60) -> FrameFeatures:
    """The features of these backgrounds by a static camera, one background after the other."""
    parts = []
    for scene in scenes:
        random = np.random.default_rng(scene)
        xy = random.uniform([0, 0], [960, 540], (num_features, 2)).astype(np.float32)
        parts.append((xy, random.integers(0, 256, (num_features, 128)).astype(np.uint8)))
    xy, descriptors = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return FrameFeatures(frame, xy, descriptors, np.zeros((0, 4), np.float32))


def pairs(key_frames: list[list[FrameFeatures]]) -> list[tuple[int, int]]:
    return [(edge.shot_a, edge.shot_b) for edge in find_shot_edges(key_frames, K=K)]


def test_shots_of_one_background_are_joined_however_far_apart() -> None:
    assert pairs([[seen(k, scene)] for k, scene in enumerate([1, 2, 1, 3, 2])]) == [(0, 2), (1, 4)]


def test_a_shot_that_failed_has_no_edge() -> None:
    assert pairs([[], [seen(1, 1)], [], [seen(3, 1)]]) == [(1, 3)]
    assert pairs([]) == [] and pairs([[seen(0, 1)]]) == []


def test_a_static_camera_that_returns_is_one_comparison() -> None:
    (edge,) = find_shot_edges([[seen(0, 1), seen(5, 1)], [seen(9, 1), seen(12, 1)]], K=K)
    (frames,) = edge.frames
    assert frames.same_camera and (frames.frame_a, frames.frame_b) == (5, 9)  # those closest in time


def test_a_long_video_compares_shots_apart_only_where_their_strongest_features_agree() -> None:
    def video(num_shots: int) -> list[list[FrameFeatures]]:
        """The first and the last shot share a background, the last one among its weak features."""
        middle = [[seen(k, 10 + k)] for k in range(1, num_shots - 1)]
        first, last = seen(0, 1, 2, num_features=QUICK_FEATURES), seen(99, 3, 2, num_features=QUICK_FEATURES)
        return [[first], *middle, [last]]

    assert pairs(video(COMPARE_ALL)) == [(0, COMPARE_ALL - 1)]
    assert pairs(video(COMPARE_ALL + 1)) == []
    everywhere = [[seen(k, 1 + k % 2)] for k in range(COMPARE_ALL + 1)]
    assert pairs(everywhere) == sorted(((a, b) for b in range(9) for a in range(b % 2, b, 2)), key=lambda p: p[::-1])


@pytest.mark.parametrize(
    ("angle_deg", "inliers", "focal_uncertainty", "expected"),
    [(0.0, 300, 0.0, np.hypot(3, 1)), (30.0, 150, 0.1, np.sqrt(9 + 9 + 4)), (30.0, 10**9, 0.0, 3.0)],
)
def test_a_rotation_is_off_by_its_angle_times_the_focal_error_and_by_its_lack_of_inliers(
    angle_deg: float, inliers: int, focal_uncertainty: float, expected: float
) -> None:
    R = rotvec_to_rotmat(np.radians([0, angle_deg, 0]))
    assert sigma_deg(ViewHypothesis(R, inliers, 0.9, "plane"), focal_uncertainty) == pytest.approx(expected)
    assert sigma_deg(ViewHypothesis(R, inliers, 0.9, "same camera"), focal_uncertainty) == 0.2
