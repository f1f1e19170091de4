"""Crops and the maps between their pixels and the picture's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from humanmm.models.perception.regions import Region, body_region, invert, transform

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


@pytest.mark.parametrize(("factor", "outlier"), [(1.0, False), (1.2, False), (1.5, True), (0.6, True)])
def test_a_region_of_another_size_is_an_outlier(factor: float, outlier: bool) -> None:
    region = Region(50, 50, 100)
    assert region.scaled(factor).outlier_of(region, shift=0.1, ratio=1.3) is outlier
