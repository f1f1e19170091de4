"""Clothing, hair, skin and face of one person as a UV atlas: the front and the back of the T-pose side by side.

A point of the body24 template (x to the body's left, y up, metres) lies in the atlas's front or back half by the side
that its triangle faces. Cloth and hair are displaced from the skin by a centimetre or two.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from humanmm.models.body.body24 import Body
from humanmm.models.rendering.textures import colour, fractal

Array = np.ndarray

PX_PER_M = 320
LEFT_M, TOP_M = -0.96, 0.88
WIDTH, HEIGHT = round(1.92 * PX_PER_M), round(1.9 * PX_PER_M)
"""Of one half; the back lies to the right of the front."""

WAIST_M, KNEE_M, ANKLE_M = 0.10, -0.435, -0.84
NECK_M, HAIRLINE_M = 0.515, 0.755
_SKINS = ((60, 40, 32), (98, 66, 48), (141, 98, 72), (186, 138, 108), (218, 172, 142), (236, 196, 170))
_HAIR = ((22, 18, 16), (48, 32, 22), (92, 58, 30), (150, 105, 55), (205, 170, 105), (150, 150, 150), (140, 50, 25))


@dataclass(frozen=True, eq=False)
class Clothing:
    """How one person looks."""

    atlas: UInt8[Array, "h 2w 3"]
    displacement_m: Float[Array, " V"]
    """How far each vertex is moved outwards along its normal."""


def atlas_coordinates(points: Float[Array, "n 3"]) -> Float[Array, "n 2"]:
    """Points of the template to pixels of the atlas's front half (continuous, first pixel's centre at .5)."""
    return np.stack([(points[:, 0] - LEFT_M) * PX_PER_M, (TOP_M - points[:, 1]) * PX_PER_M], axis=1)


def random_clothing(body: Body, rng: np.random.Generator) -> Clothing:
    """Random skin, hair and clothes."""
    x = (np.arange(WIDTH) + 0.5) / PX_PER_M + LEFT_M
    y = TOP_M - (np.arange(HEIGHT) + 0.5) / PX_PER_M
    cut = _Cut.random(rng)
    template = body.v_template.astype(np.float64)
    skin = np.array(_SKINS[int(rng.integers(len(_SKINS)))]) * rng.uniform(0.92, 1.08)
    hair = np.array(_HAIR[int(rng.integers(len(_HAIR)))]) * rng.uniform(0.8, 1.2)
    trousers, shirt = _cloth(rng), _cloth(rng)
    shoes = colour(rng, value=(0.08, 0.95), saturation=(0.0, 0.7))
    halves = []
    for back in (False, True):
        half = np.empty((HEIGHT, WIDTH, 3), np.float32)
        half[:] = skin * (1 + 0.02 * fractal(rng, HEIGHT, WIDTH, slope=1.0)[..., None])
        X, Y = np.abs(x)[None], y[:, None]
        if not back:
            _draw_face(half, skin)
        for region, cloth in ((cut.trousers(X, Y), trousers), (cut.shirt(X, Y, back=back), shirt)):
            half[region] = cloth[region]
        half[cut.shoes(X, Y)] = shoes
        half[cut.hair(X, Y, back=back)] = hair
        if cut.belt:
            half[(np.abs(Y - WAIST_M + 0.02) < 0.02) & (X < 0.3)] = shoes * 0.6
        halves.append(half)
    grain = cv2.GaussianBlur(rng.normal(size=(HEIGHT, 2 * WIDTH)).astype(np.float32), (0, 0), 1.2)
    atlas = np.concatenate(halves, axis=1) * (1 + 0.08 * grain[..., None])
    X, Y = np.abs(template[:, 0]), template[:, 1]
    behind = template[:, 2] < 0.02
    displacement = np.zeros(len(template))
    displacement[cut.trousers(X, Y)] = cut.trousers_loose_m
    shirted = cut.shirt(X, Y, back=False) | (cut.shirt(X, Y, back=True) & behind)
    displacement[shirted] = cut.shirt_loose_m
    displacement[cut.shoes(X, Y)] = 0.008
    displacement[np.where(behind, cut.hair(X, Y, back=True), cut.hair(X, Y, back=False))] = cut.hair_m
    return Clothing(np.clip(np.rint(atlas), 0, 255).astype(np.uint8), displacement.astype(np.float32))


@dataclass(frozen=True)
class _Cut:
    """Where clothes and hair end, metres on the template; X is |x|."""

    sleeve_x: float
    hem_y: float
    leg_y: float
    neckline_y: float
    hair_back_y: float
    hairline_y: float
    hair_m: float
    shirt_loose_m: float
    trousers_loose_m: float
    belt: bool

    @classmethod
    def random(cls, rng: np.random.Generator) -> "_Cut":
        short, bald = rng.random() < 0.45, rng.random() < 0.06
        return cls(
            sleeve_x=float(rng.choice([0.24, 0.33, 0.40, 0.67, 0.67])),
            hem_y=rng.uniform(-0.13, 0.04),
            leg_y=float(rng.choice([-0.25, KNEE_M + 0.03, KNEE_M - 0.08])) if short else ANKLE_M + rng.uniform(0, 0.03),
            neckline_y=rng.uniform(0.42, 0.51),
            hair_back_y=rng.uniform(0.55, 0.68),
            hairline_y=9.0 if bald else HAIRLINE_M + rng.uniform(-0.02, 0.015),
            hair_m=0.0 if bald else rng.uniform(0.008, 0.028),
            shirt_loose_m=rng.uniform(0.006, 0.018),
            trousers_loose_m=rng.uniform(0.005, 0.016),
            belt=rng.random() < 0.4,
        )

    def shirt(self, X: Array, Y: Array, *, back: bool) -> Bool[Array, "*shape"]:
        collar = (NECK_M if back else self.neckline_y) + 0.9 * X > Y
        return np.asarray((self.hem_y < Y) & (self.sleeve_x > X) & collar)

    def trousers(self, X: Array, Y: Array) -> Bool[Array, "*shape"]:
        return np.asarray((Y < WAIST_M) & (self.leg_y < Y) & (X < 0.45))

    def shoes(self, X: Array, Y: Array) -> Bool[Array, "*shape"]:
        return np.asarray((Y < ANKLE_M) & (X < 0.45))

    def hair(self, X: Array, Y: Array, *, back: bool) -> Bool[Array, "*shape"]:
        if self.hairline_y > 1.0:
            return np.zeros(np.broadcast_shapes(X.shape, Y.shape), bool)
        if back:
            return np.asarray((self.hair_back_y < Y) & (X < 0.14))
        return np.asarray((self.hairline_y - 1.2 * np.maximum(X - 0.055, 0) < Y) & (X < 0.14) & (Y > 0.66))


def _cloth(rng: np.random.Generator) -> Float[Array, "h w 3"]:
    """A cloth as large as one half of the atlas."""
    ground, thread = (colour(rng, value=(0.12, 0.95), saturation=(0.0, 0.75)) for _ in range(2))
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] / PX_PER_M
    pitch = rng.uniform(0.03, 0.10)
    across, along = (np.sin(2 * np.pi * v / pitch) > rng.uniform(-0.3, 0.7) for v in (x, y))
    kind = int(rng.choice(6, p=[0.45, 0.15, 0.08, 0.12, 0.10, 0.10]))
    pattern = (
        np.zeros((HEIGHT, WIDTH)), along, across, (across.astype(float) + along) / 2,
        fractal(rng, HEIGHT, WIDTH, slope=1.4) > 0.4,
        (np.hypot(x + LEFT_M, TOP_M - y - 0.27) < 0.09) | (np.abs(TOP_M - y - 0.27) < 0.02),
    )[kind]  # fmt: skip
    folds = 0.05 * fractal(rng, HEIGHT, WIDTH, slope=1.6)[..., None]
    return np.asarray((ground + (thread - ground) * np.asarray(pattern, np.float64)[..., None]) * (1 + folds))


def _draw_face(half: Float[Array, "h w 3"], skin: Array) -> None:
    """Eyes, brows, mouth and the shadow under the nose."""

    def at(x_m: float, y_m: float) -> tuple[int, int]:
        u, v = atlas_coordinates(np.array([[x_m, y_m, 0]]))[0]
        return round(float(u)), round(float(v))

    for side in (-1, 1):
        cv2.ellipse(half, at(side * 0.031, 0.699), (5, 3), 0, 0, 360, (235, 235, 230), -1)
        cv2.circle(half, at(side * 0.031, 0.699), 2, (40, 28, 20), -1)
        cv2.line(half, at(side * 0.018, 0.717), at(side * 0.046, 0.719), (0.45 * skin).tolist(), 3)
    cv2.line(half, at(-0.010, 0.650), at(0.010, 0.650), (0.7 * skin).tolist(), 2)
    cv2.line(half, at(-0.022, 0.628), at(0.022, 0.628), (skin * [0.85, 0.5, 0.5]).tolist(), 4)
