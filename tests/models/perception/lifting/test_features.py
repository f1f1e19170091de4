"""What the lifter reads does not depend on where in the picture somebody is."""

import numpy as np

from humanmm.models.geometry.projection import project
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.perception.interfaces import PersonFrames
from humanmm.models.perception.lifting.features import lifter_input, view_axes

K = np.array([[600.0, 0, 320], [0, 600, 180], [0, 0, 1]])


def frames(points: np.ndarray, landmarks3d: np.ndarray) -> PersonFrames:
    pixels = project(points[None], K, near_m=0.1)
    centre = project(points.mean(axis=0)[None, None], K, near_m=0.1)[:, 0]
    keypoints = np.concatenate([pixels, np.full((1, 33, 1), 0.4)], axis=-1)
    # a crop as wide as the same angle, wherever it is
    ray = np.append((centre[0] - K[:2, 2]) / 600, 1.0)
    return PersonFrames(np.zeros(1), keypoints, landmarks3d, centre, np.array([120.0 * (ray @ ray)]))


def test_a_person_looks_alike_wherever_he_stands() -> None:
    points = np.array([0.0, 0.0, 5.0]) + np.random.default_rng(0).normal(0, 0.2, (33, 3))
    R = rotvec_to_rotmat(np.array([0.0, 0.3, 0.0]))
    ahead, aside = (lifter_input(frames(one, np.zeros((1, 33, 3))), K) for one in (points, points @ R.T))
    a, b = ahead.points.numpy(), aside.points.numpy()
    assert np.abs(b * np.median(a / b) - a).max() < 0.02


def test_the_view_axes_look_at_the_crop() -> None:
    R = view_axes(np.array([[320.0, 180.0], [620.0, 180.0]]), K)
    assert np.allclose(R[0], np.eye(3)) and np.allclose(R[1][:, 2], [1 / np.sqrt(5), 0, 2 / np.sqrt(5)])
