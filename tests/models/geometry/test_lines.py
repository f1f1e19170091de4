"""Straight lines through values over time."""

import numpy as np

from humanmm.models.geometry.lines import line_through


def test_value_and_slope_of_a_line_are_found_again() -> None:
    value, slope = np.array([[1.0, 2.0, 3.0], [0.0, -1.0, 5.0]]), np.array([[0.5, 0.0, -2.0], [4.0, 1.0, 0.0]])
    x = np.array([-0.3, 0.1, 0.2, 0.7])
    found = line_through(x, value + x[:, None, None] * slope)
    np.testing.assert_allclose(found, (value, slope), atol=1e-12)


def test_noise_is_divided_among_all() -> None:
    at_zero, slope = line_through(np.array([-1.0, 0.0, 1.0]), np.array([1.0, -2.0, 1.0]))
    np.testing.assert_allclose([at_zero, slope], [0.0, 0.0], atol=1e-12)
