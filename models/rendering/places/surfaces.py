"""Textures that repeat exactly, and what is printed on walls: what makes two places look like one.

Those of `rendering.textures` are stained, so that no two tiles are the same; these repeat to the last grey level.
"""

import cv2
import numpy as np

from humanmm.models.rendering.textures import Texture, as_bytes, colour, concrete, fractal, plaster

Array = np.ndarray

_WORDS = (
    "ARENA", "CITY BANK", "NORD", "SPORT 24", "AQUA", "MOTOR", "EXIT", "LIVE", "CUP 2026", "RADIO ONE", "KAFFEE",
    "SALE", "HOTEL", "OPEN", "TICKETS", "FITNESS", "STUDIO 7", "WELCOME", "PIZZA", "BOOKS", "AIR", "GATE 12",
)  # fmt: skip
_FONTS = (cv2.FONT_HERSHEY_SIMPLEX, cv2.FONT_HERSHEY_DUPLEX, cv2.FONT_HERSHEY_TRIPLEX, cv2.FONT_HERSHEY_COMPLEX)


def tiling(rng: np.random.Generator) -> Texture:
    """Square tiles, all of one kind or in two shades: the smallest part that repeats."""
    px, side_m = 48, rng.uniform(0.25, 0.7)
    one = colour(rng, value=(0.35, 0.95), saturation=(0.0, 0.4))
    other = one if rng.random() < 0.4 else one * rng.uniform(0.3, 0.8)
    image = np.empty((2 * px, 2 * px, 3), np.float32)
    image[:] = one
    image[:px, px:], image[px:, :px] = other, other
    image *= 1 + 0.04 * fractal(rng, 2 * px, 2 * px, slope=0.8)[..., None]
    joint = 255 * rng.uniform(0.15, 0.75)
    for line in (0, px):
        image[line : line + 2], image[:, line : line + 2] = joint, joint
    return Texture(as_bytes(image), px / side_m)


def bricks(rng: np.random.Generator) -> Texture:
    """A running bond in which every second course is the same: bricks, or blocks twice as large."""
    clay = 255 * rng.uniform(0.35, 0.8) * np.array([1.0, rng.uniform(0.5, 1.0), rng.uniform(0.4, 1.0)])
    height, width, joint = 16, 50, 2
    image = np.empty((2 * height, 2 * width, 3), np.float32)
    image[:] = rng.uniform(110, 215)
    for row in range(2):
        course = np.repeat(clay * (1 + 0.15 * rng.normal(size=(2, 1))), width, axis=0)
        course[np.arange(2 * width) % width < joint] = image[0, 0]
        image[row * height + joint : (row + 1) * height] = np.roll(course, row * width // 2, axis=0)
    image *= 1 + 0.05 * fractal(rng, 2 * height, 2 * width, slope=0.6)[..., None]
    return Texture(as_bytes(image), 200 / float(rng.choice([1, 1, 2])))


def wall_panels(rng: np.random.Generator) -> Texture:
    """Boards of about a metre with seams and screws."""
    px, side_m = 128, rng.uniform(0.7, 1.4)
    image = np.empty((px, px, 3), np.float32)
    image[:] = colour(rng, value=(0.4, 0.95), saturation=(0.0, 0.5))
    image *= 1 + 0.05 * fractal(rng, px, px, slope=1.2)[..., None]
    image[:3] *= 0.5
    image[:, :3] *= 0.5
    for x in (12, px - 10):
        for y in (12, px - 10):
            cv2.circle(image, (x, y), 3, (50, 50, 50), -1)
    return Texture(as_bytes(image), px / side_m)


def nothing(rng: np.random.Generator, *, value: tuple[float, float] = (0.86, 0.97)) -> Texture:
    """Paint without a mark on it: a studio's walls and floor."""
    paint = colour(rng, value=value, saturation=(0.0, 0.04))
    return Texture(as_bytes(paint * (1 + 0.006 * fractal(rng, 256, 256, slope=1.8)[..., None])), 32)


def court(rng: np.random.Generator) -> Texture:
    """Boards of a sports hall, exactly periodic, in one colour."""
    image = np.empty((64, 256, 3), np.float32)
    image[:] = 255 * rng.uniform(0.5, 0.8) * np.array([1.0, 0.78, 0.52])
    image *= 1 + 0.06 * cv2.resize(fractal(rng, 64, 32, slope=0.7), (256, 64))[..., None]
    image[::16] *= 0.75
    return Texture(as_bytes(image), 160)


def asphalt(rng: np.random.Generator) -> Texture:
    """Concrete or asphalt without slabs."""
    image = concrete(rng).image[8:184, 8:184]
    return Texture(np.ascontiguousarray(image), 64)


def seats(rng: np.random.Generator) -> Texture:
    """Folding seats on concrete steps, half a metre each."""
    px = 48
    image = np.full((px, px, 3), rng.uniform(90, 150), np.float32)
    shell = colour(rng, value=(0.3, 0.9), saturation=(0.4, 0.95))
    cv2.rectangle(image, (6, 4), (px - 7, 30), shell.tolist(), -1)
    cv2.rectangle(image, (6, 31), (px - 7, 38), (0.6 * shell).tolist(), -1)
    cv2.rectangle(image, (10, 39), (px - 11, px - 1), (45, 45, 45), -1)
    return Texture(as_bytes(image), 2 * px)


def window(rng: np.random.Generator) -> Texture:
    """A window with a cross, a metre wide; it is hung scaled."""
    image = np.empty((128, 128, 3), np.float32)
    glass = np.array([rng.uniform(120, 200), rng.uniform(150, 220), rng.uniform(180, 245)])
    image[:] = glass * np.linspace(1.05, 0.8, 128)[:, None, None]
    frame = colour(rng, value=(0.2, 1.0), saturation=(0.0, 0.5)).tolist()
    cv2.rectangle(image, (0, 0), (127, 127), frame, 14)
    cv2.line(image, (64, 0), (64, 127), frame, 6)
    cv2.line(image, (0, 50), (127, 50), frame, 6)
    return Texture(as_bytes(image), 128)


def board(rng: np.random.Generator) -> Texture:
    """A sponsor's board with a word and a sign, 3 × 1 parts."""
    height = 80
    image = np.empty((height, 3 * height, 3), np.uint8)
    image[:] = colour(rng, value=(0.15, 1.0), saturation=(0.0, 0.9)).astype(np.uint8)
    ink = tuple(int(255 - v) if rng.random() < 0.8 else 245 for v in image[0, 0])
    cv2.circle(image, (42, 40), int(rng.integers(16, 30)), ink, -1 if rng.random() < 0.5 else 6, cv2.LINE_AA)
    _write(image, str(rng.choice(_WORDS)), (82, 8, 148, 64), ink, rng)
    image[:3], image[-3:], image[:, :3] = 30, 30, 30
    return Texture(image, height)


def sign(rng: np.random.Generator) -> Texture:
    """A shop's sign or a banner: only letters, 4 × 1 parts."""
    height = 64
    image = np.empty((height, 4 * height, 3), np.uint8)
    image[:] = colour(rng, value=(0.1, 1.0), saturation=(0.0, 0.9)).astype(np.uint8)
    _write(image, str(rng.choice(_WORDS)), (10, 8, 236, 48), tuple(int(255 - v) for v in image[0, 0]), rng)
    return Texture(image, height)


def lit_facade(rng: np.random.Generator) -> Texture:
    """A storey at night: one window in three is lit."""
    image = plaster(rng).image[:128, :256].astype(np.float32) * 0.35
    for column in range(4):
        lit = rng.random() < 0.35
        glass = (250, 215, 140) if lit else (18, 20, 28)
        cv2.rectangle(image, (64 * column + 14, 34), (64 * column + 50, 92), glass, -1)
    return Texture(as_bytes(image), 40)


def _write(
    image: Array, word: str, box: tuple[int, int, int, int], ink: tuple[int, ...], rng: np.random.Generator
) -> None:
    """A word as large as fits into x, y, width, height."""
    font = int(_FONTS[int(rng.integers(len(_FONTS)))])
    (width, height), _ = cv2.getTextSize(word, font, 1.0, 2)
    scale = min(box[2] / width, box[3] / height)
    at = (box[0], box[1] + (box[3] + int(height * scale)) // 2)
    cv2.putText(image, word, at, font, scale, ink, max(2, round(2.5 * scale)), cv2.LINE_AA)
