"""Whether two looks show one person: log-odds of the colours of the body's parts and of the clothes.

Across cuts (`shots.identity`) and behind something that hid him (`tracking.linking`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from humanmm.models.perception.clothing import GROUND, colour_distance


@dataclass(frozen=True)
class ColourModel:
    """A logistic regression: log-odds for the same person."""

    constant: float
    clothes: float
    """For a Hellinger distance of 1 between the histograms of the clothes."""
    parts: float = 0.0
    """For a factor of e between the distances of the body's parts."""
    ground: float = 0.0
    """For a distance of 1 between the colours of the ground that they stand on."""

    def odds(self, clothes: float, parts: float = 0.0, ground: float = 0.0) -> float:
        """For these distances."""
        return self.constant + self.clothes * clothes + self.parts * parts + self.ground * ground


SAME_COLOURS, SAME_CLOTHES = ColourModel(0.67, -2.82, -8.96, -0.05), ColourModel(4.58, -10.54)
"""With and without colours of the parts, fitted by `scripts/fit_identity`. Constants are 0.75 below what is likeliest
there, where as many pairs are of one person as of two."""
COLOUR_LIMIT = 5.0
_FEWEST_PARTS, _DOUBTED_PARTS = 3, 4
SAME_APART = -0.3
PART_LIMIT = 40.0
"""A part that is further apart counts as this: a limb that lies elsewhere, a sleeve on one side only."""
_NOISE, _LEAST_CONTRAST = 2.0, 5.0
"""Added to both distances, so that neither is taken for smaller than it can be measured."""
_OF_LIGHT, _WEIGHT = np.array([1, 0.5, 0.5]), np.array([0.7, 1, 1])
"""Of L*, a*, b*: how much of what all parts have in common is the light's (at most LIGHT_LIMIT of L*); how much a
difference counts."""
LIGHT_LIMIT = 20.0
_GROUND_WEIGHT = np.array([0.5, 1, 1])
GROUND_LIMIT, GROUND_UNKNOWN = 20.0, 10.0
"""Ground that is further apart is another one; what counts where it is not seen, between the same and another."""


def same_look_odds(
    clothes_a: Float[np.ndarray, " bins"],
    parts_a: Float[np.ndarray, "9 3"],
    clothes_b: Float[np.ndarray, " bins"],
    parts_b: Float[np.ndarray, "9 3"],
) -> float:
    """Log-odds, positive for one person, of two looks: histogram of the clothes, colours of the parts (NaN: not seen).

    Without parts that both show the clothes alone count.
    """
    if not (clothes_a.any() and clothes_b.any()):
        return 0.0
    clothes, parts = colour_distance(clothes_a, clothes_b), part_distance(parts_a, parts_b)
    if parts is None:
        odds = SAME_CLOTHES.odds(clothes)
    else:
        odds = SAME_COLOURS.odds(clothes, parts, ground_distance(parts_a, parts_b))
    return float(np.clip(odds, -COLOUR_LIMIT, COLOUR_LIMIT))


def median_parts(samples: Sequence[Float[np.ndarray, "9 3"]] | Float[np.ndarray, "n 9 3"]) -> Float[np.ndarray, "9 3"]:
    """Of `clothing.part_colours` over time; NaN where a part is never seen."""
    if not len(samples):
        return np.full((GROUND + 1, 3), np.nan)
    stacked = np.asarray(samples)
    seen = np.isfinite(stacked).any(axis=0)
    return np.where(seen, np.nanmedian(np.where(seen, stacked, 0.0), axis=0), np.nan)


def part_distance(a: Float[np.ndarray, "9 3"], b: Float[np.ndarray, "9 3"]) -> float | None:
    """Logarithm of how far the colours of two bodies are apart over how much their own parts differ, above SAME_APART
    and the less the fewer parts both show; None if they are too few.

    Two people in black from head to foot are near each other and yet not likely one; two with the same red shirt above
    the same blue trousers are. A camera's exposure and white balance change all parts alike: what the parts'
    differences have in common is taken away, of colour a half, since people also dress in one colour.
    """
    seen = np.isfinite(a[:GROUND, 0]) & np.isfinite(b[:GROUND, 0])
    if np.count_nonzero(seen) < _FEWEST_PARTS:
        return None
    a, b = a[:GROUND][seen].astype(np.float64), b[:GROUND][seen].astype(np.float64)
    contrast = float(np.linalg.norm(((a + b) / 2).std(axis=0)))
    light = np.clip(np.median(a - b, axis=0), -LIGHT_LIMIT, LIGHT_LIMIT)
    apart = np.linalg.norm(_WEIGHT * (a - b - _OF_LIGHT * light), axis=1)
    ratio = float(np.log((np.minimum(apart, PART_LIMIT).mean() + _NOISE) / (contrast + _LEAST_CONTRAST)))
    count = np.count_nonzero(seen)
    return (ratio - SAME_APART) * count / (count + _DOUBTED_PARTS)


def ground_distance(a: Float[np.ndarray, "9 3"], b: Float[np.ndarray, "9 3"]) -> float:
    """How far the colours of the ground under two people are apart: whether the place may be the same."""
    distance = float(np.linalg.norm(_GROUND_WEIGHT * (a[GROUND].astype(np.float64) - b[GROUND])))
    return min(distance, GROUND_LIMIT) if np.isfinite(distance) else GROUND_UNKNOWN
