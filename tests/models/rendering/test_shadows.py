"""A shadow lies where the lamp's ray through its cause meets the floor."""

import numpy as np
import pytest

from humanmm.models.rendering.background_scene import BackgroundScene, Block, Light
from humanmm.models.rendering.shadows import draw_block_shadow, draw_person_shadow
from humanmm.models.rendering.view import FLOOR, Sample, View

LIGHT = Light(np.array([1.0, 0.0, 1.0]) / np.sqrt(2), lamp=0.5, ambient=0.5)
"""From +x, 45° up: a point at height h throws its shadow h metres towards −x."""
SCENE = BackgroundScene("test", (), (), LIGHT)


@pytest.fixture
def view() -> View:
    """10 m above the origin, looking down: x to the right, y up in the picture, 20 px a metre."""
    R = np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]])
    return View(R, np.array([0.0, 0, 10]), np.array([[200.0, 0, 100], [0, 200, 60], [0, 0, 1]]), 200, 120)


@pytest.fixture
def sample(view: View) -> Sample:
    """White floor everywhere."""
    sample = Sample.empty(view)
    sample.image[:], sample.owner[:] = 255, FLOOR
    return sample


def _extent(sample: Sample) -> tuple[float, float, float, float]:
    rows, columns = np.nonzero(sample.image[..., 0] < 200)
    return (
        (columns.min() - 100) / 20,
        (columns.max() + 1 - 100) / 20,
        (60 - rows.max() - 1) / 20,
        (60 - rows.min()) / 20,
    )


def test_a_block_of_a_metre_darkens_its_foot_and_a_metre_beside_it(view: View, sample: Sample) -> None:
    draw_block_shadow(sample, view, Block(np.zeros(2), np.array([0.5, 1.0]), 1.0, 0.0, ()), SCENE)
    assert _extent(sample) == pytest.approx((-1.5, 0.5, -1.0, 1.0), abs=0.15)
    assert sample.image.min() == pytest.approx(255 * (1 - LIGHT.shadow), abs=2)


def test_a_triangle_in_the_air_is_projected_along_the_ray(view: View, sample: Sample) -> None:
    vertices = np.array([[1.0, -1, 2], [3, -1, 2], [3, 1, 2]])
    draw_person_shadow(sample, view, vertices, np.array([[0, 1, 2], [2, 1, 0]]), SCENE)
    assert _extent(sample) == pytest.approx((-1.0, 1.0, -1.0, 1.0), abs=0.2)


def test_only_the_floor_is_darkened(view: View, sample: Sample) -> None:
    sample.owner[:] = FLOOR + 1
    draw_block_shadow(sample, view, Block(np.zeros(2), np.ones(2), 1.0, 0.0, ()), SCENE)
    assert (sample.image == 255).all()
