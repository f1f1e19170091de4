"""People who do not move: drawn once into a texture, for pictures on walls and screens, and for crowds far away."""

from dataclasses import dataclass

import cv2
import numpy as np

from humanmm.models.body.body24 import load_body
from humanmm.models.geometry.intrinsics import K_from_focal
from humanmm.models.rendering.background_scene import Light
from humanmm.models.rendering.people import draw_person
from humanmm.models.rendering.renderer import ClothedActor
from humanmm.models.rendering.textures import Texture, colour, fractal
from humanmm.models.rendering.view import FIRST_PERSON, Sample, View
from humanmm.models.synthetic.mocap import Actor
from humanmm.models.synthetic.rigs import look_at

Array = np.ndarray

FIGURE_M = 2.2
"""Height of what a figure's texture shows."""
_FINER = 2
_LIGHT = Light(np.array([0.3, -0.4, 0.866]), 0.5, 0.6)


@dataclass(frozen=True, eq=False)
class Model:
    """Somebody who is drawn."""

    actor: Actor
    clothed: ClothedActor

    @classmethod
    def dressed(cls, actor: Actor, rng: np.random.Generator) -> "Model":
        """In random clothes."""
        return cls(actor, ClothedActor(actor, load_body(), rng, mesh="drawn"))


def picture(model: Model, frame: int, rng: np.random.Generator, *, height_px: int = 160) -> Texture:
    """A poster or a screen with the person before a coloured ground; as wide as 0.7 of its height."""
    rgb, alpha = _drawn(model, frame, height_px, yaw=rng.uniform(-1.2, 1.2))
    ground = colour(rng, value=(0.3, 1.0), saturation=(0.1, 0.8))
    shades = ground * (1 + 0.1 * fractal(rng, *alpha.shape, slope=1.5)[..., None])
    image = np.clip(np.where(alpha[..., None] > 127, rgb, shades), 0, 255).astype(np.uint8)
    image[:3], image[-3:], image[:, :3], image[:, -3:] = 25, 25, 25, 25
    return Texture(image, height_px)


def cut_out(model: Model, frame: int, rng: np.random.Generator, *, height_px: int = 96) -> Texture:
    """The person alone, seen from the front: 0.7 × FIGURE_M wide, FIGURE_M high."""
    rgb, alpha = _drawn(model, frame, height_px, yaw=rng.uniform(-0.6, 0.6))
    return Texture(np.dstack([rgb, alpha]), height_px / FIGURE_M)


def _drawn(model: Model, frame: int, height_px: int, *, yaw: float) -> tuple[Array, Array]:
    """Colours and coverage (0..255), h × 0.7 h, the soles at the lower edge."""
    height, width = _FINER * height_px, _FINER * round(0.7 * height_px)
    pelvis = model.actor.joints[frame, 0]
    facing = model.actor.R_world_root[frame][:, 2]
    heading = np.arctan2(facing[1], facing[0]) + yaw
    middle = np.append(pelvis[:2], FIGURE_M / 2 - 0.02)
    away = 9.0
    eye = middle + away * np.array([np.cos(heading), np.sin(heading), 0.0])
    focal = height * away / FIGURE_M
    K = K_from_focal(focal, width, height)
    view = View(look_at(eye, middle), eye, K, width, height)
    sample = Sample.empty(view)
    draw_person(sample, view, model.clothed.at(float(frame)), _LIGHT, FIRST_PERSON)
    size = (width // _FINER, height_px)
    alpha = cv2.resize((sample.owner == FIRST_PERSON).astype(np.uint8) * 255, size, interpolation=cv2.INTER_AREA)
    rgb = cv2.resize(sample.image, size, interpolation=cv2.INTER_AREA).astype(np.float32)
    rgb = rgb / np.maximum(alpha[..., None] / 255.0, 0.25)
    # What lies outside the outline takes the nearest colour, so that coarser levels have no dark seam.
    spread = cv2.dilate(np.clip(rgb, 0, 255).astype(np.uint8), np.ones((3, 3), np.uint8), iterations=3)
    return np.where(alpha[..., None] > 127, np.clip(rgb, 0, 255).astype(np.uint8), spread), alpha
