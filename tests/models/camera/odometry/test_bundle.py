"""The adjustment's derivatives are right, and it finds what made the observations."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from humanmm.models.camera.odometry.bundle import (
    Freedom,
    Observations,
    Points,
    Views,
    adjust,
    image_jacobian,
    project,
    residuals,
)
from humanmm.models.geometry.rotations import rotation_angle, rotvec_to_rotmat


def problem(rng: np.random.Generator, num_images: int = 6, num_points: int = 80) -> tuple[Views, Points, Observations]:
    """Views around a cloud of points, and exact sightings of all points in all views."""
    R = Rotation.from_euler("yx", rng.normal(0, 4, (num_images, 2)), degrees=True).as_matrix()
    t = rng.normal(0, 0.4, (num_images, 3))
    views = Views(R[0].T @ R, (t - t[0]) @ R[0], np.zeros(num_images), 800.0)
    X = rng.uniform([-3, -2, 4], [3, 2, 9], (num_points, 3))
    distance = np.linalg.norm(X, axis=1)
    points = Points(X / distance[:, None], 1 / distance, np.zeros_like(X))
    image, point = np.divmod(np.arange(num_images * num_points), num_points)
    observations = Observations(image, point, np.zeros((len(image), 2)))
    return views, points, replace(observations, xy=project(views, points, observations)[1])


def test_the_jacobian_of_a_view_is_the_numerical_one(rng: np.random.Generator) -> None:
    views, points, observations = problem(rng)
    freedom = Freedom(translation=True, zoom=True)
    q, xy = project(views, points, observations)
    J, _ = image_jacobian(views, points.rho, observations, q, q[:, 2] > 0, freedom)
    step = 1e-6
    for column in range(7):
        delta = np.zeros((6, 7))
        delta[:, column] = step
        nudged = Views(
            views.R_shot_cam @ rotvec_to_rotmat(delta[:, :3]), views.t_shot_cam + delta[:, 3:6], delta[:, 6], 800.0
        )
        numerical = (project(nudged, points, observations)[1] - xy) / step
        np.testing.assert_allclose(J[:, :, column], numerical, atol=2e-2, rtol=1e-4)


@pytest.mark.parametrize("outliers", [0.0, 0.15])
def test_disturbed_views_and_points_return_to_the_truth(outliers: float, rng: np.random.Generator) -> None:
    views, points, observations = problem(rng)
    wrong = rng.random(len(observations.image)) < outliers
    xy = observations.xy + np.where(wrong[:, None], rng.normal(0, 80, observations.xy.shape), 0.0)
    disturbed = replace(
        views,
        R_shot_cam=views.R_shot_cam @ rotvec_to_rotmat(rng.normal(0, 0.01, (6, 3)) * (np.arange(6) > 0)[:, None]),
        t_shot_cam=views.t_shot_cam + rng.normal(0, 0.05, (6, 3)) * (np.arange(6) > 0)[:, None],
    )
    result = adjust(
        disturbed, replace(points, rho=points.rho * 1.2), replace(observations, xy=xy), fixed=np.arange(6) == 0,
        freedom=Freedom(translation=True), iterations=50,
    )  # fmt: skip
    assert np.degrees(rotation_angle(np.swapaxes(views.R_shot_cam, 1, 2) @ result.views.R_shot_cam)).max() < 0.02
    assert np.median(residuals(result.views, result.points, observations)) < 0.05


def test_fixed_views_do_not_move(rng: np.random.Generator) -> None:
    views, points, observations = problem(rng)
    fixed = np.arange(6) < 3
    result = adjust(
        views, replace(points, rho=points.rho * 1.1), observations, fixed=fixed, freedom=Freedom(translation=True)
    )
    np.testing.assert_array_equal(result.views.t_shot_cam[fixed], views.t_shot_cam[fixed])
    np.testing.assert_allclose(result.views.R_shot_cam[fixed], views.R_shot_cam[fixed], atol=1e-12)
