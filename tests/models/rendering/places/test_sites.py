"""Every place holds what it is built around, has what it is for, and can be drawn."""

import numpy as np
import pytest

from humanmm.models.rendering.background_scene import BackgroundScene
from humanmm.models.rendering.panels import draw_background
from humanmm.models.rendering.places.figures import Model, cut_out, picture
from humanmm.models.rendering.places.furnishing import Ground
from humanmm.models.rendering.places.sites import PLACES, build_place
from humanmm.models.rendering.view import View
from humanmm.models.synthetic.mocap import Actor
from humanmm.models.synthetic.rigs import look_at

KEEP_IN = np.array([[0, 0, 0.9], [1.0, 0.5, 0.9], [5.0, 0, 1.6], [-3.0, 3.0, 1.2]])


@pytest.fixture(scope="module")
def ground(actor: Actor) -> Ground:
    rng = np.random.default_rng(0)
    model = Model.dressed(actor, rng)
    pictures = [picture(model, 3, rng)]
    return Ground(KEEP_IN, KEEP_IN[:, :2], KEEP_IN[:, :2], [cut_out(model, 3, rng)], pictures)


@pytest.fixture(scope="module", params=list(PLACES))
def place(request: pytest.FixtureRequest, ground: Ground) -> BackgroundScene:
    return build_place(request.param, ground, np.random.default_rng(4))


def test_it_is_drawn_from_every_side_without_a_hole(place: BackgroundScene) -> None:
    eye = np.array([5.0, 0, 1.6])
    K = np.array([[90.0, 0, 48], [0, 90, 27], [0, 0, 1]])
    for target in ((0, 0, 1.0), (9, 3, 1.2), (5.1, 9, 0.5)):
        view = View(look_at(eye, np.array(target)), eye, K, 96, 54)
        image = draw_background(view, place).image
        assert (image.sum(axis=-1) == 0).mean() < 0.02


def test_nothing_stands_where_people_and_cameras_are(place: BackgroundScene) -> None:
    for block in place.blocks:
        away = np.abs((KEEP_IN[:, :2] - block.centre) @ np.array([[np.cos(block.yaw), -np.sin(block.yaw)],
                                                                [np.sin(block.yaw), np.cos(block.yaw)]]))  # fmt: skip
        assert (away > block.half).any(axis=1).all()


def test_opposite_walls_of_a_tiled_hall_are_twins(ground: Ground) -> None:
    shell = build_place("tiled hall", ground, np.random.default_rng(2)).shell
    walls = shell[2:6]
    for one, other in ((0, 2), (1, 3)):
        assert walls[one].texture is walls[other].texture
        hung = [[p for p in shell[6:] if np.allclose(p.along, walls[k].along)] for k in (one, other)]
        assert [p.texture.image.tobytes() for p in hung[0]] == [p.texture.image.tobytes() for p in hung[1]]


def test_letters_on_walls_can_be_read_from_inside(ground: Ground) -> None:
    """Who looks at the wall sees the texture's first column at the left."""
    for wall in build_place("gallery", ground, np.random.default_rng(2)).shell[2:6]:
        inside = np.array([0.0, 0.0, 1.5])
        forward = wall.corner + 0.5 * wall.size[0] * wall.along - inside
        forward[2] = 0
        assert np.cross(forward, [0, 0, 1.0]) @ wall.along > 0


def test_a_studio_shows_almost_nothing(ground: Ground) -> None:
    for panel in build_place("studio", ground, np.random.default_rng(0)).shell:
        assert panel.texture.image.std(axis=(0, 1)).max() < 4
