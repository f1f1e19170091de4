"""A crop is what its region of the whole picture shows."""

import numpy as np

from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.learning.crops import Degradation, crop_view
from humanmm.models.perception.regions import Region, invert, transform
from humanmm.models.rendering.view import View


def test_a_point_lies_in_the_crop_where_the_region_has_it() -> None:
    R, t = rotvec_to_rotmat(np.array([0.3, -0.2, 0.1])), np.array([0.5, -1.0, 0.2])
    K = np.array([[700.0, 0, 320], [0, 700, 180], [0, 0, 1]])
    region = Region(410.0, 120.0, 150.0, angle=0.6)
    points = np.array([0.2, 0.1, 4.0]) + np.random.default_rng(0).normal(0, 0.4, (20, 3))
    world = points @ R.T + t
    whole, crop = View(R, t, K, 640, 360), crop_view(R, t, K, region, 96)
    pixels = whole.project(whole.to_camera(world))
    expected = transform(invert(region.to_source(96)), pixels)
    np.testing.assert_allclose(crop.project(crop.to_camera(world)), expected, atol=1e-9)


def test_compression_and_grain_change_a_picture_but_not_what_it_shows() -> None:
    image = np.full((64, 64, 3), 120, np.uint8)
    image[20:40, 20:40] = 200
    rng = np.random.default_rng(0)
    clean, bad = (Degradation(0.0, noise, quality).applied(image, rng) for noise, quality in ((0.0, 100), (5.0, 20)))
    assert np.array_equal(clean, image)
    assert not np.array_equal(bad, image) and abs(bad.mean() - image.mean()) < 5
