"""Panels lie where the camera sees them, and the floor is known as the floor."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.rendering.background_scene import BackgroundScene, Light, Panel
from humanmm.models.rendering.panels import draw_background
from humanmm.models.rendering.textures import Texture
from humanmm.models.rendering.view import BLOCK, FLOOR, SKY, View


def test_a_panel_lands_where_its_corners_are_projected() -> None:
    """A black square on white, head-on at 4 m with f = 200 px: its edges are 200 · 0.5 / 4 = 25 px from the centre."""
    image = np.full((200, 200, 3), 255, np.uint8)
    image[50:150, 50:150] = 0
    wall = Panel(
        np.array([-1.0, 4.0, 2.0]), np.array([1.0, 0, 0]), np.array([0, 0, -1.0]), (2.0, 2.0), Texture(image, 100), 1.0
    )
    scene = BackgroundScene("test", (wall,), (), _LIGHT)
    picture = draw_background(_view(np.array([0.0, 0.0, 1.0])), scene).image[..., 0]
    dark = np.argwhere((picture < 128) & (np.add.outer(np.abs(np.arange(120) - 60), np.abs(np.arange(160) - 80)) < 90))
    inner = dark[(np.abs(dark - [60, 80]) < 40).all(axis=1)]
    assert inner.min(axis=0) == pytest.approx([35, 55], abs=1)
    assert inner.max(axis=0) == pytest.approx([84, 104], abs=1)


def test_the_floor_is_known_as_floor() -> None:
    grey = Texture(np.full((8, 8, 3), 100, np.uint8), 8)
    floor = Panel(
        np.array([-9.0, -9, 0]), np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), (18, 18), grey, 1.0, is_floor=True
    )
    owner = draw_background(_view(np.array([0.0, 0.0, 1.5])), BackgroundScene("test", (floor,), (), _LIGHT)).owner
    assert (owner[-1] == FLOOR).all()
    assert (owner[0] == SKY).all()


def test_a_cut_out_hides_only_where_it_is_and_only_from_its_front() -> None:
    image = np.full((100, 100, 4), 255, np.uint8)
    image[:, :50, 3] = 0
    figure = Panel(
        np.array([-0.5, 4.0, 1.5]), np.array([1.0, 0, 0]), np.array([0, 0, -1.0]), (1.0, 1.0), Texture(image, 100), 1.0
    )
    scene = BackgroundScene("test", (), (), _LIGHT, (figure,))
    sample = draw_background(_view(np.array([0.0, 0.0, 1.0])), scene)
    assert sample.owner[60, 90] == BLOCK
    assert sample.inverse_depth[60, 90] == pytest.approx(0.25)
    assert sample.owner[60, 70] == SKY
    behind = replace(figure, corner=np.array([0.5, 4.0, 1.5]), along=np.array([-1.0, 0, 0]))
    turned = replace(scene, cutouts=(behind,))
    assert not draw_background(_view(np.array([0.0, 0.0, 1.0])), turned).owner.any()


_LIGHT = Light(np.array([0.2, 0.1, 0.97]) / np.linalg.norm([0.2, 0.1, 0.97]), 0.5, 0.5)


def _view(eye: np.ndarray) -> View:
    """A level camera that looks along +y."""
    R = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    return View(R, eye, np.array([[200.0, 0, 80], [0, 200, 60], [0, 0, 1]]), 160, 120)
