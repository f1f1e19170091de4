"""Regions of hands: from the body, and from the hand's own landmarks."""

import numpy as np
import pytest

from humanmm.models.perception.hands.crops import BODY_SCALE, of_body, of_points


def body(wrist: tuple[float, float], index: tuple[float, float], pinky: tuple[float, float]) -> np.ndarray:
    """Landmarks of a body whose right hand is there, its left one nowhere."""
    keypoints = np.ones((33, 3))
    keypoints[[16, 20, 18], :2] = wrist, index, pinky
    return keypoints


def test_a_hand_is_looked_for_upright_about_its_knuckles() -> None:
    region = of_body(body((100, 100), (140, 97), (140, 106)), 1)
    assert region is not None
    assert (region.x, region.y) == pytest.approx((140, 100))
    assert region.angle == pytest.approx(np.pi / 2)
    assert region.side == pytest.approx(2 * 40 * BODY_SCALE)


def test_a_hand_without_extent_has_no_region() -> None:
    assert of_body(body((100, 100), (100, 100), (100, 100)), 1) is None


def test_the_next_region_goes_with_the_hand() -> None:
    points = np.random.default_rng(0).normal(0, 8, (21, 2)) + np.linspace([0, 40], [0, -40], 21)
    here = of_points(points)
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])  # clockwise on the picture, whose y is down
    there = of_points(2 * points @ turn.T + [300, 200])
    assert there.side == pytest.approx(2 * here.side)
    assert there.angle - here.angle == pytest.approx(np.pi / 2)
    np.testing.assert_allclose([there.x, there.y], 2 * turn @ [here.x, here.y] + [300, 200])
