"""The map of a moving camera as points with their certainty."""

import numpy as np

from humanmm.models.camera.odometry.bundle import Adjusted, Observations, Points, Views
from humanmm.models.camera.odometry.keyframe_odometry import Track
from humanmm.models.camera.odometry.scenery import scenery_of


def test_points_are_where_the_map_has_them_and_as_certain_as_their_parallax() -> None:
    places = np.array([[0.0, 0.0, 4.0], [1.0, 0.0, 40.0], [0.0, 1.0, 4.0], [0.0, 0.0, 9.0]])
    t = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.4, 0.0, 0.0]])
    distance = np.linalg.norm(places, axis=1)
    points = Points(places / distance[:, None], 1 / distance, np.zeros((4, 3)))
    views = Views(np.tile(np.eye(3), (3, 1, 1)), t, np.zeros(3), 500.0)
    point = np.array([0, 1, 2, 0, 1, 2, 0, 1])  # the third point is not seen by the last view; the fourth is not known
    image = np.array([0, 0, 0, 1, 1, 1, 2, 2])
    sightings = Observations(image, point, np.zeros((8, 2)))
    adjusted = Adjusted(views, points, np.full(8, 0.5), 1.0, 0.5)
    track = Track(np.arange(3), views, points, np.array([True, True, True, False]), adjusted, sightings, sightings)
    R = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    found = scenery_of(track, np.array([0.0, 0.0, 1.0]), R)
    assert np.allclose(found.positions, (places[:3] - [0, 0, 1]) @ R.T, atol=1e-5)
    parallax = np.array([np.arctan2(0.4, 4.0), 0.01, np.arctan2(0.2, np.hypot(4, 1))])
    assert np.allclose(found.relative_std, 0.001 / parallax, rtol=0.02)
