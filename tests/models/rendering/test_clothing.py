"""Clothing: every vertex lies inside the atlas, clothes stand off the skin by centimetres, seeds repeat."""

import numpy as np

from humanmm.models.body.body24 import load_body
from humanmm.models.rendering.clothing import HEIGHT, LEFT_M, PX_PER_M, TOP_M, WIDTH, atlas_coordinates, random_clothing


def test_the_template_fits_into_the_atlas_and_a_metre_is_as_many_pixels_as_it_says() -> None:
    pixels = atlas_coordinates(load_body().v_template.astype(np.float64))
    assert (pixels >= 0).all() and (pixels < [WIDTH, HEIGHT]).all()
    corner, other = atlas_coordinates(np.array([[LEFT_M, TOP_M, 0], [LEFT_M + 1, TOP_M - 1, 0]]))
    np.testing.assert_allclose(corner, 0, atol=1e-9)
    np.testing.assert_allclose(other, PX_PER_M)


def test_one_seed_is_one_outfit_and_displacements_are_centimetres() -> None:
    body = load_body()
    one, same, other = (random_clothing(body, np.random.default_rng(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.atlas, same.atlas)
    assert (one.atlas != other.atlas).mean() > 0.3
    assert one.atlas.shape == (HEIGHT, 2 * WIDTH, 3)
    assert one.displacement_m.min() >= 0 and 0.005 < one.displacement_m.max() < 0.03
