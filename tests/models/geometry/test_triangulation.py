"""Points from several cameras: exact without errors, right although a camera is wrong, unknown where too few agree."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from humanmm.models.geometry.projection import project, world_to_camera
from humanmm.models.geometry.triangulation import triangulated

C = 4
POINTS = np.random.default_rng(2).normal(size=(6, 5, 3))
R = np.stack([Rotation.from_euler("y", 90 * k, degrees=True).as_matrix() for k in range(C)])
T = -5.0 * R[:, :, 2]  # all look at the origin
ONES, LIMIT = np.ones((C, 6, 5)), np.full((C, 1, 1), 0.02)


def seen() -> np.ndarray:
    """(C, 6, 5, 2) the ideal pictures."""
    in_camera = world_to_camera(np.broadcast_to(POINTS.reshape(-1, 3), (C, 30, 3)), R, T)
    return project(in_camera, np.eye(3), near_m=0.1).reshape(C, 6, 5, 2)


def test_rays_that_meet_give_the_point() -> None:
    points, error = triangulated(seen(), ONES, R, T, LIMIT)
    np.testing.assert_allclose(points, POINTS, atol=1e-9)
    assert error.shape == (C, 6, 5) and error.max() < 1e-9


def test_a_camera_that_sees_something_else_is_not_heard_and_its_error_is_told() -> None:
    xy = seen()
    xy[2, 1] += 0.3
    points, error = triangulated(xy, ONES, R, T, LIMIT)
    np.testing.assert_allclose(points, POINTS, atol=1e-9)
    assert (error[2, 1] > 0.2).all() and error[[0, 1, 3]].max() < 1e-9


def test_where_too_few_agree_nothing_is_known() -> None:
    xy, weight = seen(), ONES.copy()
    weight[2:, 0] = 0  # two cameras
    xy[1:, 1] = np.nan  # one
    xy[:, 2] += np.array([[0.3], [-0.2], [0.1], [-0.4]])[:, None] * [1.0, -1.0]  # four that contradict each other
    assert np.isnan(triangulated(xy, weight, R, T, LIMIT, least=3)[0]).all(axis=(1, 2))[:3].all()
    two, error = triangulated(xy, weight, R, T, LIMIT, least=2)
    np.testing.assert_allclose(two[0], POINTS[0], atol=1e-9)
    assert np.isnan(two[1]).all() and np.isnan(error[2:, 0]).all()


def test_rays_that_meet_behind_a_camera_give_no_point() -> None:
    ahead = np.stack([np.eye(3)] * 2), np.array([[0.0, 0, 0], [1.0, 0, 0]])
    apart = np.array([[[-0.1, 0.0]], [[0.1, 0.0]]])  # these lines meet five metres behind both
    points, _ = triangulated(apart, np.ones((2, 1)), *ahead, np.full((2, 1), 0.5))
    assert np.isnan(points).all()


def test_one_camera_is_refused() -> None:
    with pytest.raises(ValueError, match="1 camera: a point needs 2"):
        triangulated(seen()[:1], ONES[:1], R[:1], T[:1], LIMIT[:1])
