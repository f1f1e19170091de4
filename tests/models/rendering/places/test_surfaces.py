"""Textures that repeat: both halves of a tile texture that must be equal are, and words fit on their boards."""

import numpy as np
import pytest

from humanmm.models.rendering.places import surfaces

MAKERS = (
    surfaces.tiling, surfaces.bricks, surfaces.wall_panels, surfaces.nothing, surfaces.court, surfaces.asphalt,
    surfaces.seats, surfaces.window, surfaces.board, surfaces.sign, surfaces.lit_facade,
)  # fmt: skip


@pytest.mark.parametrize("make", MAKERS)
def test_a_texture_is_small_opaque_and_the_same_for_the_same_seed(make: object) -> None:
    assert callable(make)
    one, same = (make(np.random.default_rng(1)) for _ in range(2))
    np.testing.assert_array_equal(one.image, same.image)
    assert one.image.dtype == np.uint8
    assert one.image.shape[2] == 3
    assert one.image.size < 3 * 300 * 300
    assert len(one.levels) >= 4


def test_a_word_does_not_touch_the_edge_of_its_sign() -> None:
    for seed in range(12):
        image = surfaces.sign(np.random.default_rng(seed)).image.astype(int)
        edge = np.concatenate([image[0], image[-1], image[:, 0], image[:, -1]])
        assert (edge == image[0, 0]).all()
