"""How well the verticals of several shots agree, if some of them may be wrong.

Each shot has a vertical of its own (`levelling`). Under rotations of the shots they should be one direction. Von
Mises-Fisher densities about it, relative to that of all directions being equally likely; the direction itself is
integrated out.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from humanmm.models.motion.rotations.rotation_mixtures import Upright

Array = np.ndarray

WRONG, WRONG_DEG = 0.05, 30.0
"""Probability that a shot's vertical is wrong in a way that its standard deviation does not show, and how wrong it is
then. Of 286 with a standard deviation below 4 degrees (rendered places and ordinary clips) 9 are off by more than three
of them, 2 by 65 and 73 degrees: walls whose floor was taken for one of them."""
_WRONG_KAPPA = 1 / math.radians(WRONG_DEG) ** 2


class Agreement(NamedTuple):
    """What verticals say of n sets of rotations."""

    log_density: Float[Array, "*n"]
    kappa: Float[Array, "*n S"]
    """The concentration with which each shot's vertical counts there."""


@dataclass(frozen=True, eq=False)
class Verticals:
    """Where up is in S shots, in their own axes."""

    up: Float[Array, "S 3"]
    """0 where it is not known."""
    kappa: Float[Array, " S"]
    """Concentrations; 0 where up is not known."""

    @classmethod
    def of(cls, upright: Sequence[Upright | None]) -> "Verticals":
        """One a shot."""
        return cls(
            np.stack([one.direction if one is not None else np.zeros(3) for one in upright]),
            np.array([1 / math.radians(one.sigma_deg) ** 2 if one is not None else 0.0 for one in upright]),
        )

    @property
    def kappa_if_wrong(self) -> Float[Array, " S"]:
        """Concentrations of verticals that are wrong."""
        return np.asarray(np.minimum(self.kappa, _WRONG_KAPPA))

    def log_density(self, R: Float[Array, "n S 3 3"]) -> Agreement:
        """How well they agree under each of n sets of rotations, with those taken for wrong that do not fit the rest.

        Which ones do is decided about the best of the shots' own directions.
        """
        known = np.flatnonzero(self.kappa > 0)
        kappa = np.zeros((len(R), len(self.kappa)))
        if len(known) < 2:
            return Agreement(np.zeros(len(R)), np.broadcast_to(self.kappa, kappa.shape))
        right, wrong = self.kappa[known], self.kappa_if_wrong[known]
        direction = np.einsum("nsab,sb->nsa", R[:, known], self.up[known])
        cosine = direction @ np.swapaxes(direction, -1, -2)
        log_right = math.log1p(-WRONG) + right * cosine - log_sinhc(right)
        log_wrong = math.log(WRONG) + wrong * cosine - log_sinhc(wrong)
        best = np.maximum(log_right, log_wrong).sum(axis=-1).argmax(axis=-1)
        fits = np.take_along_axis(log_right >= log_wrong, best[:, None, None], axis=1)[:, 0]
        chosen = np.where(fits, right, wrong)
        mean = np.linalg.norm((chosen[..., None] * direction).sum(axis=1), axis=-1)
        log_prior = np.where(fits, math.log1p(-WRONG), math.log(WRONG)).sum(axis=1)
        kappa[:, known] = chosen
        return Agreement(log_prior + log_sinhc(mean) - log_sinhc(chosen).sum(axis=1), kappa)


def curvature(kappa: Float[Array, "*n S"]) -> Float[Array, "*n S S"]:
    """Of minus the logarithm of how well verticals of these concentrations agree, by rotations of their shots about one
    level axis, where they do: diag κ − κ κᵀ / Σ κ. Rotations of all shots alike change nothing."""
    total = np.maximum(kappa.sum(axis=-1), 1e-9)[..., None, None]
    return np.asarray(kappa[..., None] * np.eye(kappa.shape[-1]) - kappa[..., :, None] * kappa[..., None, :] / total)


def log_sinhc(x: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """log(sinh(x) / x)."""
    x = np.maximum(x, 1e-6)
    return np.asarray(x + np.log1p(-np.exp(-2 * x)) - np.log(2 * x))
