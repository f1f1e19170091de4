"""Colours of people and shots, the same in every picture. RGB, 0..255."""

import numpy as np
from jaxtyping import UInt8

from humanmm.models.records.recording import RecordedPerson
from humanmm.models.records.shots import DOUBTFUL

RGB = tuple[int, int, int]

PEOPLE: tuple[RGB, ...] = (
    (74, 144, 255), (255, 140, 66), (30, 120, 0), (180, 0, 195), (0, 195, 135), (255, 195, 0),
    (225, 45, 90), (120, 60, 255), (180, 180, 255), (60, 135, 150), (255, 60, 210), (120, 225, 210),
)  # fmt: skip
"""The largest distance in Oklab between the nearest two that a search found: at least 0.14 apart, and 0.09 without red
or green cones; also apart from `CONTACT`, `CUT` and `NOT_OBSERVED`, and visible on white and on a dark page."""
SHOTS: tuple[RGB, ...] = ((92, 124, 168), (168, 128, 84), (104, 150, 116), (148, 110, 158), (160, 96, 100))
CONTACT: RGB = (70, 235, 120)
CUT: RGB = (255, 84, 84)
NOT_OBSERVED: RGB = (150, 150, 155)
WHITE: RGB = (245, 246, 248)
INK: RGB = (18, 20, 24)


def person_color(person: RecordedPerson) -> RGB:
    """Colour of a person, by number; grey for somebody who may be nobody."""
    return NOT_OBSERVED if person.probability < DOUBTFUL else PEOPLE[person.person % len(PEOPLE)]


def shot_color(shot: int) -> RGB:
    """Colour of a shot, by number: neighbours differ."""
    return SHOTS[shot % len(SHOTS)]


def shading_ramp(color: RGB) -> UInt8[np.ndarray, "256 3"]:
    """Colours of a surface from dark to lit: through the colour itself, the brightest fifth runs towards white."""
    light = np.linspace(0, 1, 256)[:, None]
    base = np.array(color, np.float64)
    lit = base * np.minimum(0.16 + 1.0 * light, 1.0)
    highlight = np.clip((light - 0.78) / 0.22, 0, 1) * 0.55
    return np.round(lit + (255 - lit) * highlight).astype(np.uint8)
