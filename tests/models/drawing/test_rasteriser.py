"""The rasteriser against geometry that is known in closed form."""

import numpy as np
from scipy.spatial import ConvexHull

from humanmm.models.drawing.rasteriser import (
    clip_polygon,
    fill_polygons,
    fill_triangles,
    front_facing,
    linear_coefficients,
)

SQUARE = np.array([[10.0, 10], [50, 10], [50, 50], [10, 50]])


def test_the_last_triangle_is_in_front_and_the_rest_is_background() -> None:
    far, near = SQUARE[[0, 1, 2]], SQUARE[[0, 1, 2]] * 0.5 + 10
    number = fill_triangles(np.stack([far, near]), 64, 64)
    assert number[60, 60] == 0
    assert number[12, 45] == 1
    assert number[18, 25] == 2


def test_the_filled_area_is_that_of_the_triangle() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        corners = rng.uniform(5, 395, (3, 2))
        area, perimeter = ConvexHull(corners).volume, ConvexHull(corners).area
        filled = (fill_triangles(corners[None], 400, 400) > 0).sum()
        assert abs(filled - area) < perimeter, "OpenCV also fills the pixels that the border touches"


def test_overlapping_polygons_are_filled_once_each() -> None:
    mask = fill_polygons([SQUARE, SQUARE + 20], 80, 80, 7)
    assert set(np.unique(mask)) == {0, 7}
    assert (mask > 0).sum() == 41 * 41 + 41 * 41 - 21 * 21


def test_a_linear_function_is_recovered_from_the_corners() -> None:
    rng = np.random.default_rng(1)
    corners = rng.uniform(0, 100, (50, 3, 2))
    truth = rng.normal(size=(2, 3))
    values = corners @ truth[:, :2].T + truth[:, 2]
    a, b, c = linear_coefficients(corners, values)
    for found, wanted in zip((a, b, c), truth.T, strict=True):
        np.testing.assert_allclose(found, np.tile(wanted, (50, 1)), atol=1e-6)


def test_the_gradient_of_a_sliver_is_bounded() -> None:
    sliver = np.array([[[0.0, 0], [10, 0], [10, 0.01]]])
    a, b, _ = linear_coefficients(sliver, np.array([[[0.0], [0], [1]]]), steepest=0.1)
    assert abs(a[0, 0]) <= 0.1
    assert b[0, 0] == 0.1


def test_triangles_that_are_counter_clockwise_from_outside_face_the_camera() -> None:
    """Counter-clockwise as seen, with y up, is clockwise in pixels, with y down."""
    x, y = np.array([[0.0], [1], [0]]), np.array([[0.0], [0], [-1]])
    assert front_facing(x, y).tolist() == [True]
    assert front_facing(-x, y).tolist() == [False]


def test_a_square_that_is_cut_in_half_keeps_half_of_its_area_and_all_coordinates() -> None:
    points = np.concatenate([SQUARE, SQUARE.sum(axis=1, keepdims=True)], axis=1)
    half = clip_polygon(points, points[:, 0] - 30)
    assert ConvexHull(half[:, :2]).volume == 40 * 20
    np.testing.assert_allclose(half[:, 2], half[:, 0] + half[:, 1])
    assert half[:, 0].min() == 30


def test_a_polygon_beyond_the_plane_vanishes_and_one_before_it_stays() -> None:
    assert len(clip_polygon(SQUARE, SQUARE[:, 0] - 99)) == 0
    np.testing.assert_array_equal(clip_polygon(SQUARE, SQUARE[:, 0]), SQUARE)
