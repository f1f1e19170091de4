"""Poses of single images against known points."""

import numpy as np
from scipy.spatial.transform import Rotation

from humanmm.models.camera.odometry.bundle import Freedom, Observations, Points, Views, project
from humanmm.models.camera.odometry.resection import resect
from humanmm.models.geometry.rotations import rotation_angle, rotvec_to_rotmat

FREEDOM = Freedom(translation=True, zoom=True)


def problem(num_images: int = 4, num_points: int = 120) -> tuple[Views, Points, Observations]:
    """Views before a cloud of points, and all sightings, a tenth of which are wrong by some 60 pixels."""
    rng = np.random.default_rng(5)
    R = Rotation.from_euler("yx", rng.normal(0, 4, (num_images, 2)), degrees=True).as_matrix()
    views = Views(R, rng.normal(0, 0.4, (num_images, 3)), rng.normal(0, 0.05, num_images), 800.0)
    X = rng.uniform([-3, -2, 4], [3, 2, 9], (num_points, 3))
    distance = np.linalg.norm(X, axis=1)
    points = Points(X / distance[:, None], 1 / distance, np.zeros_like(X))
    image, point = np.divmod(np.arange(num_images * num_points), num_points)
    xy = project(views, points, Observations(image, point, np.zeros((len(image), 2))))[1]
    wrong = rng.random(len(image)) < 0.1
    return views, points, Observations(image, point, xy + np.where(wrong[:, None], rng.normal(0, 60, xy.shape), 0.0))


def nearby(views: Views) -> Views:
    rng = np.random.default_rng(6)
    n = len(views.log_zoom)
    return Views(
        views.R_shot_cam @ rotvec_to_rotmat(rng.normal(0, 0.02, (n, 3))),
        views.t_shot_cam + rng.normal(0, 0.05, (n, 3)), np.zeros(n), views.focal_px,
    )  # fmt: skip


def test_views_return_to_the_truth_in_spite_of_outliers() -> None:
    views, points, observations = problem()
    found, residual_px, enough = resect(nearby(views), points, observations, freedom=FREEDOM, iterations=20)
    assert enough.all()
    assert np.degrees(rotation_angle(np.swapaxes(views.R_shot_cam, 1, 2) @ found.R_shot_cam)).max() < 0.01
    np.testing.assert_allclose(found.t_shot_cam, views.t_shot_cam, atol=1e-3)
    np.testing.assert_allclose(found.log_zoom, views.log_zoom, atol=1e-3)
    assert np.median(residual_px) < 0.05


def test_an_image_with_too_few_sightings_stays_where_it_is() -> None:
    views, points, observations = problem()
    start = nearby(views)
    kept = observations.select((observations.image != 2) | (observations.point < 5))
    found, _, enough = resect(start, points, kept, freedom=FREEDOM)
    assert enough.tolist() == [True, True, False, True]
    np.testing.assert_allclose(found.R_shot_cam[2], start.R_shot_cam[2], atol=1e-12)
    np.testing.assert_array_equal(found.t_shot_cam[2], start.t_shot_cam[2])


def test_without_any_sighting_nothing_moves() -> None:
    views, points, observations = problem()
    nothing = observations.select(np.zeros(len(observations.image), bool))
    found, residual_px, enough = resect(views, points, nothing, freedom=FREEDOM)
    assert found is views
    assert not len(residual_px)
    assert not enough.any()
