"""Procedural textures: all surfaces of a background scene. Nothing is read from a file.

Most are periodic, so that they can be tiled without a visible edge. Colours are RGB, 0..255.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from jaxtyping import Float, UInt8

Array = np.ndarray
Colour = Float[Array, "3"]

MOST_LEVELS = 8


@dataclass(frozen=True, eq=False)
class Texture:
    """A picture that covers `image.shape / px_per_m` metres and repeats."""

    image: UInt8[Array, "h w c"]
    """RGB; a fourth channel above 127 says where there is anything."""
    px_per_m: float

    @cached_property
    def levels(self) -> tuple[Array, ...]:
        """The picture at full, half, quarter … resolution (a mipmap: Williams 1983)."""
        levels = [self.image]
        while len(levels) < MOST_LEVELS and min(levels[-1].shape[:2]) >= 2:
            height, width = levels[-1].shape[:2]
            levels.append(cv2.resize(levels[-1], (width // 2, height // 2), interpolation=cv2.INTER_AREA))
        return tuple(levels)


def fractal(rng: np.random.Generator, height: int, width: int, *, slope: float = 1.5) -> Float[Array, "h w"]:
    """Periodic noise with a spectrum of 1/fˢ, mean 0, variance 1; the steeper, the smoother."""
    f = np.hypot(np.fft.fftfreq(height)[:, None] * height, np.fft.rfftfreq(width)[None] * width)
    f[0, 0] = np.inf
    noise = np.fft.irfft2(np.fft.rfft2(rng.normal(size=(height, width))) * f**-slope, s=(height, width))
    return np.asarray((noise / noise.std()).astype(np.float32))


def colour(rng: np.random.Generator, *, value: tuple[float, float], saturation: tuple[float, float]) -> Colour:
    """A random hue with brightness and saturation (0..1) in these ranges."""
    hsv = np.array([[[rng.uniform(0, 360), rng.uniform(*saturation), rng.uniform(*value)]]], np.float32)
    return np.asarray(255 * cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB)[0, 0])


def plaster(rng: np.random.Generator) -> Texture:
    """A painted wall, slightly stained."""
    paint = colour(rng, value=(0.55, 0.95), saturation=(0.03, 0.35))
    stains = 0.05 * fractal(rng, 512, 512, slope=1.6) + 0.03 * fractal(rng, 512, 512, slope=0.4)
    return _painted(paint, stains, 128)


def brick(rng: np.random.Generator) -> Texture:
    """Bricks of 25 × 8 cm in a running bond."""
    clay = 255 * rng.uniform(0.4, 0.75) * np.array([1.0, rng.uniform(0.5, 0.9), rng.uniform(0.4, 0.8)])
    mortar = np.full(3, rng.uniform(130, 200))
    height, width, joint = 16, 48, 2
    rows, columns = 32, 10
    image = np.empty((rows * height, columns * width, 3), np.float32)
    image[:] = mortar
    for row in range(rows):
        shades = clay * (1 + 0.13 * rng.normal(size=(columns, 1)))
        line = np.repeat(shades, width, axis=0)
        line[np.arange(columns * width) % width < joint] = mortar
        shift = width // 2 * (row % 2)
        image[row * height + joint : (row + 1) * height] = np.roll(line, shift, axis=0)
    return _roughened(rng, image, 0.09, 192)


def planks(rng: np.random.Generator) -> Texture:
    """Boards of 12 cm, with grain."""
    wood = 255 * rng.uniform(0.35, 0.8) * np.array([1.0, rng.uniform(0.68, 0.85), rng.uniform(0.4, 0.7)])
    size, board = 480, 20
    grain = cv2.resize(fractal(rng, size, size // 8, slope=0.7), (size, size))[:, ::1].T
    image = np.empty((size, size, 3), np.float32)
    image[:] = wood
    for first in range(0, size, board):
        image[first : first + board] *= 1 + 0.12 * rng.normal()
        image[first : first + 1] *= 0.45
        joint = int(rng.integers(size))
        image[first : first + board, joint : joint + 2] *= 0.5
    return Texture(as_bytes(image * (1 + 0.08 * grain[..., None])), 160)


def tiles(rng: np.random.Generator) -> Texture:
    """Square tiles in two shades."""
    one = colour(rng, value=(0.35, 0.9), saturation=(0.02, 0.35))
    other = one * rng.uniform(0.5, 1.05)
    side, count = 64, 8
    checks = (np.add.outer(np.arange(count), np.arange(count)) % 2)[..., None]
    image = np.where(checks, one, other) * (1 + 0.05 * rng.normal(size=(count, count, 1)))
    image = np.repeat(np.repeat(image, side, axis=0), side, axis=1)
    image[::side], image[:, ::side], image[1::side], image[:, 1::side] = 90, 90, 90, 90
    return _roughened(rng, image, 0.05, side / rng.uniform(0.3, 0.6))


def carpet(rng: np.random.Generator) -> Texture:
    """Short pile with a woven border pattern."""
    ground, thread = (colour(rng, value=(0.25, 0.7), saturation=(0.1, 0.6)) for _ in range(2))
    y, x = np.mgrid[0:256, 0:256]
    figure = (np.sin(x * 2 * np.pi / 64) * np.sin(y * 2 * np.pi / 64) > rng.uniform(0.1, 0.6))[..., None]
    return _roughened(rng, np.where(figure, thread, ground).astype(np.float32), 0.12, 128, slope=0.3)


def concrete(rng: np.random.Generator) -> Texture:
    """Concrete or asphalt with stains and cracks between slabs."""
    grey = np.full(3, rng.uniform(80, 170)) * rng.uniform(0.94, 1.06, 3)
    stains = 0.10 * fractal(rng, 768, 768, slope=1.3) + 0.08 * fractal(rng, 768, 768, slope=0.2)
    texture = _painted(grey, stains, 96)
    image = texture.image.copy()
    if rng.random() < 0.6:
        image[::192] = image[::192] // 2
        image[:, ::192] = image[:, ::192] // 2
    return Texture(image, 96)


def grass(rng: np.random.Generator) -> Texture:
    """A lawn."""
    green = np.array([rng.uniform(70, 120), rng.uniform(110, 150), rng.uniform(40, 80)])
    blades = 0.16 * fractal(rng, 768, 768, slope=0.35) + 0.12 * fractal(rng, 768, 768, slope=1.4)
    return _painted(green, blades, 96)


def foliage(rng: np.random.Generator) -> Texture:
    """A hedge."""
    green = np.array([rng.uniform(40, 80), rng.uniform(75, 120), rng.uniform(30, 60)])
    return _painted(green, 0.35 * fractal(rng, 384, 384, slope=0.9), 96)


def facade(rng: np.random.Generator) -> Texture:
    """A storey of a house: windows with frames and blinds in a plastered wall; 6.4 × 3.2 m."""
    wall = plaster(rng).image[:205, :410].astype(np.float32)
    frame = colour(rng, value=(0.2, 0.95), saturation=(0.0, 0.3))
    columns = int(rng.integers(2, 5))
    width = 410 // columns
    for column in range(columns):
        x0, x1 = column * width + width // 5, (column + 1) * width - width // 5
        wall[50:165, x0:x1] = frame
        glass = colour(rng, value=(0.1, 0.5), saturation=(0.05, 0.4))
        drawn = int(rng.integers(58, 158))
        wall[57:158, x0 + 6 : x1 - 6] = glass
        wall[57:drawn, x0 + 6 : x1 - 6] = np.clip(glass * rng.uniform(1, 3), 0, 240)
        wall[57:158, (x0 + x1) // 2 - 2 : (x0 + x1) // 2 + 3] = frame
    return _roughened(rng, wall, 0.03, 64)


def sky(rng: np.random.Generator) -> Texture:
    """Clouds over a distant skyline; periodic to the sides."""
    height, width = 256, 1024
    blue = np.array([rng.uniform(110, 170), rng.uniform(150, 195), rng.uniform(190, 235)])
    elevation = np.linspace(1, 0, height)[:, None, None]
    cloud = np.clip(fractal(rng, height, width, slope=1.7)[..., None] * 0.5 + rng.uniform(-0.3, 0.5), 0, 1)
    image = blue * (1.1 - 0.25 * elevation)
    image = image + cloud * (235 - image) * (0.3 + 0.7 * elevation)
    roofs = 8 + 10 * (np.repeat(rng.random(32), width // 32) ** 2)
    town = np.arange(height)[:, None] > height - roofs[None]
    haze = colour(rng, value=(0.45, 0.6), saturation=(0.05, 0.2))
    return Texture(as_bytes(np.where(town[..., None], haze * (1 + 0.05 * rng.normal(size=(1, width, 1))), image)), 1)


def poster(rng: np.random.Generator) -> Texture:
    """A framed picture of overlapping shapes, 1 × 1 m."""
    side = 192
    image = np.empty((side, side, 3), np.uint8)
    image[:] = colour(rng, value=(0.3, 1.0), saturation=(0.1, 0.9))
    for _ in range(int(rng.integers(6, 16))):
        paint = colour(rng, value=(0.1, 1.0), saturation=(0.2, 1.0)).tolist()
        a, b = rng.integers(0, side, (2, 2)).tolist()
        shape = int(rng.integers(3))
        if shape == 0:
            cv2.rectangle(image, a, b, paint, -1)
        elif shape == 1:
            cv2.circle(image, a, int(rng.integers(5, 50)), paint, -1, cv2.LINE_AA)
        else:
            cv2.line(image, a, b, paint, int(rng.integers(2, 14)), cv2.LINE_AA)
    frame = np.zeros((side, side), bool)
    frame[:6], frame[-6:], frame[:, :6], frame[:, -6:] = True, True, True, True
    image[frame] = colour(rng, value=(0.05, 0.6), saturation=(0.0, 0.6))
    return Texture(image, side)


FLOORS: tuple[Callable[[np.random.Generator], Texture], ...] = (planks, tiles, carpet, concrete)
GROUNDS = (concrete, grass, tiles)
WALLS = (plaster, plaster, brick, planks)
SURFACES = (planks, plaster, tiles, brick, poster)


def _painted(paint: Colour, stains: Float[Array, "h w"], px_per_m: float) -> Texture:
    return Texture(as_bytes(paint * (1 + stains[..., None])), px_per_m)


def _roughened(
    rng: np.random.Generator, image: Array, strength: float, px_per_m: float, *, slope: float = 0.8
) -> Texture:
    height, width = image.shape[:2]
    return Texture(as_bytes(image * (1 + strength * fractal(rng, height, width, slope=slope)[..., None])), px_per_m)


def as_bytes(image: Array) -> UInt8[Array, "h w 3"]:
    """Grey levels rounded and kept within 0 to 255."""
    return np.asarray(np.clip(np.rint(image), 0, 255).astype(np.uint8))
