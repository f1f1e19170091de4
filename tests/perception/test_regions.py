"""Crops and the maps between their pixels and the picture's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from humanmm.models.perception.regions import Region, body_region, crop, invert, transform, whole

angles = st.floats(-3.1, 3.1)


@given(st.floats(0, 500), st.floats(0, 500), st.floats(20, 900), angles)
def test_the_centre_of_a_crop_is_the_regions_centre(x: float, y: float, side: float, angle: float) -> None:
    centre = transform(Region(x, y, side, angle).to_source(256), np.array([128.0, 128.0]))
    np.testing.assert_allclose(centre, [x, y], atol=1e-9)


@given(angles)
def test_a_body_region_stands_the_body_upright_in_its_crop(angle: float) -> None:
    hip, length = np.array([200.0, 150.0]), 80.0
    rim = hip + length * np.array([np.sin(angle), -np.cos(angle)])
    in_crop = transform(invert(body_region(hip, rim).to_source(256)), rim)
    np.testing.assert_allclose(in_crop, [128, 128 - 256 / 2.5], atol=1e-6)


def test_a_crop_of_the_same_scale_returns_the_picture_unshifted() -> None:
    image = np.random.default_rng(0).integers(0, 255, (64, 64, 3), np.uint8)
    np.testing.assert_array_equal(crop(image, whole(image), 64), image)


def test_a_bright_pixel_appears_where_the_affine_map_says() -> None:
    image = np.zeros((200, 200, 3), np.uint8)
    image[120, 80] = 255
    region = Region(90.0, 110.0, 64.0, 0.4)
    picture = crop(image, region, 256).astype(float)[..., 0]
    rows, columns = np.nonzero(picture)
    weights = picture[rows, columns]
    found = transform(region.to_source(256), np.array([columns @ weights, rows @ weights]) / weights.sum() + 0.5)
    np.testing.assert_allclose(found, [80.5, 120.5], atol=0.05)  # bilinear footprint sampled at 4 pixels a pixel


@pytest.mark.parametrize(("factor", "outlier"), [(1.0, False), (1.2, False), (1.5, True), (0.6, True)])
def test_a_region_of_another_size_is_an_outlier(factor: float, outlier: bool) -> None:
    region = Region(50, 50, 100)
    assert region.scaled(factor).outlier_of(region, shift=0.1, ratio=1.3) is outlier
