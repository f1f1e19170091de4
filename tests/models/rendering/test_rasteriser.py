"""What is painted is what the truth says: places, occlusion, light and shadow."""

import numpy as np
import pytest

from humanmm.models.rendering.background_scene import Light, Panel, Scenery
from humanmm.models.rendering.rasteriser import FLOOR, SKY, View, paint_set
from humanmm.models.rendering.renderer import Frame
from humanmm.models.rendering.script import Clip, in_view
from humanmm.models.rendering.textures import Texture


def test_visible_joints_lie_on_their_own_silhouette(clip: Clip, painted: dict[int, Frame]) -> None:
    shares = []
    for number, frame in painted.items():
        for person, actor in enumerate(clip.actors):
            pixels, _ = in_view(actor.joints[[number]], clip.shots[0], slice(number, number + 1), (256, 144))
            seen = frame.joint_seen[person]
            x, y = np.clip(pixels[0, seen].astype(int).T, 0, [[255], [143]])
            shares.append(frame.masks[person][y, x].mean())
    assert np.mean(shares) > 0.95


def test_silhouettes_do_not_overlap(painted: dict[int, Frame]) -> None:
    for frame in painted.values():
        assert frame.masks.sum(axis=0).max() <= 1
        assert frame.masks.any(axis=(1, 2))[0]


def test_a_panel_lands_where_its_corners_are_projected() -> None:
    """A black square on white, head-on at 4 m with f = 200 px: its edges are 200 · 0.5 / 4 = 25 px from the centre."""
    image = np.full((200, 200, 3), 255, np.uint8)
    image[50:150, 50:150] = 0
    wall = Panel(
        np.array([-1.0, 4.0, 2.0]), np.array([1.0, 0, 0]), np.array([0, 0, -1.0]), (2.0, 2.0), Texture(image, 100), 1.0
    )
    picture = paint_set(_view(np.array([0.0, 0.0, 1.0])), Scenery("test", (wall,), (), _LIGHT)).image[..., 0]
    dark = np.argwhere((picture < 128) & (np.add.outer(np.abs(np.arange(120) - 60), np.abs(np.arange(160) - 80)) < 90))
    inner = dark[(np.abs(dark - [60, 80]) < 40).all(axis=1)]
    assert inner.min(axis=0) == pytest.approx([35, 55], abs=1)
    assert inner.max(axis=0) == pytest.approx([84, 104], abs=1)


def test_a_lamp_overhead_lights_floors_more_than_walls() -> None:
    floor, wall = _LIGHT.on(np.array([[0, 0, 1.0], [0, 1.0, 0]]))
    assert floor > wall
    assert 0 < _LIGHT.shadow < 1


def test_the_floor_is_known_as_floor() -> None:
    grey = Texture(np.full((8, 8, 3), 100, np.uint8), 8)
    floor = Panel(
        np.array([-9.0, -9, 0]), np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), (18, 18), grey, 1.0, is_floor=True
    )
    owner = paint_set(_view(np.array([0.0, 0.0, 1.5])), Scenery("test", (floor,), (), _LIGHT)).owner
    assert (owner[-1] == FLOOR).all()
    assert (owner[0] == SKY).all()


_LIGHT = Light(np.array([0.2, 0.1, 0.97]) / np.linalg.norm([0.2, 0.1, 0.97]), 0.5, 0.5)


def _view(eye: np.ndarray) -> View:
    """A level camera that looks along +y."""
    R = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    return View(R, eye, np.array([[200.0, 0, 80], [0, 200, 60], [0, 0, 1]]), 160, 120)
