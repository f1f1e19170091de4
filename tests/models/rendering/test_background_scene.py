"""Light, and what hides what in a background scene."""

import numpy as np
import pytest

from humanmm.models.rendering.background_scene import Block, Light, build_outdoors, build_room


def test_a_lamp_overhead_lights_floors_more_than_walls() -> None:
    light = Light(np.array([0.2, 0.1, 0.97]) / np.linalg.norm([0.2, 0.1, 0.97]), 0.5, 0.5)
    floor, wall = light.on(np.array([[0, 0, 1.0], [0, 1.0, 0]]))
    assert floor > wall
    assert 0 < light.shadow < 1


def test_a_block_hides_what_is_behind_it_and_nothing_else() -> None:
    block = Block(np.array([2.0, 0.0]), np.array([0.5, 1.0]), 1.5, 0.3, ())
    eye = np.tile([0.0, 0.0, 1.0], (4, 1))
    target = np.array([[4.0, 0, 1.0], [1.0, 0, 1.0], [4.0, 4.0, 1.0], [4.0, 0, 4.0]])
    assert block.hides(eye, target).tolist() == [True, False, False, False]


@pytest.mark.parametrize("build", [build_room, build_outdoors])
def test_blocks_keep_clear_of_paths_and_of_each_other(build: object) -> None:
    assert callable(build)
    points = np.random.default_rng(0).uniform(-3, 3, (40, 3)) * [1, 1, 0.3] + [0, 0, 1]
    scene = build(points, points[:, :2], np.random.default_rng(1))
    assert scene.blocks
    for k, block in enumerate(scene.blocks):
        assert np.linalg.norm(points[:, :2] - block.centre, axis=1).min() > block.reach
        assert all(np.linalg.norm(block.centre - b.centre) > block.reach + b.reach for b in scene.blocks[:k])
