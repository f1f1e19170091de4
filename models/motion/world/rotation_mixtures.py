"""What one piece of evidence says of the rotation between two shots: a mixture of hypotheses, and of none of them.

A hypothesis' errors follow a t distribution; where none is true the rotation may be any, though most wrong ones are
rotations about the vertical. Densities are relative to that of all rotations being equally likely.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from humanmm.models.geometry.rotations import rotation_angle

Array = np.ndarray

WRONG_UPRIGHT, WRONG_TILT_DEG = 0.6, 12.0
"""Fraction of wrong rotations that are rotations about the vertical, and how closely they are."""
LEAST_NONE = 0.02
"""No edge is so certain that this probability of its being wrong altogether is not left."""
BACKGROUND_VOICES = 1.5
"""So many independent witnesses are all backgrounds of a shot that others share."""
DEGREES_OF_FREEDOM = 5.0
"""Of the t distribution of rotation errors: large ones are more frequent than a normal distribution has them."""
QUANTILE_68 = 1.88
"""68 % of isotropic normal rotation errors are smaller than this many standard deviations of one axis."""
LOG_VOLUME = math.log(8 * math.pi**2)
"""Of all rotations, in the measure in which small rotation vectors have their own volume."""
UNKNOWN_PRECISION = 2 * math.pi / (8 * math.pi**2) ** (2 / 3)
"""That of a normal distribution as wide as all rotations, radians⁻²."""
_LOG_T_PEAK = (
    math.lgamma((DEGREES_OF_FREEDOM + 3) / 2)
    - math.lgamma(DEGREES_OF_FREEDOM / 2)
    - 1.5 * math.log(DEGREES_OF_FREEDOM * math.pi)
)


@dataclass(frozen=True)
class RotationHypothesis:
    """Shot b's axes to shot a's, if this hypothesis is true."""

    R_a_b: Float[Array, "3 3"]
    sigma_deg: float
    """68 % of such rotations are off by less, when they are true."""
    probability: float
    source: str = ""
    """What it assumes or rests on, for the record."""


@dataclass(frozen=True)
class RotationEdge:
    """What one piece of evidence says of the rotation between shots a and b."""

    a: int
    b: int
    hypotheses: tuple[RotationHypothesis, ...]
    source: str = "people"
    num_inliers: int = 0
    """Background points; 0 for edges from people."""
    connects: bool = True
    """Whether it shows by itself that the two shots belong to one world."""
    pooled: bool = False
    """Made of what each of the two shots says by itself: all pairs of n shots know no more than n - 1 of them."""

    def silent(self) -> "RotationEdge":
        """The same connection, of whose hypotheses none is believed."""
        return replace(self, hypotheses=tuple(replace(one, probability=0.0) for one in self.hypotheses))


@dataclass(frozen=True)
class Upright:
    """Where up is in a shot's own axes."""

    direction: Float[Array, "3"]
    sigma_deg: float


@dataclass(frozen=True, eq=False)
class Mixture:
    """An edge with its hypotheses as arrays."""

    edge: RotationEdge
    a: int
    b: int
    R: Float[Array, "h 3 3"]
    sigma: Float[Array, " h"]
    """Standard deviation of one axis, radians."""
    log_peak: Float[Array, " h"]
    """Logarithm of a hypothesis' density at its own rotation, times its probability; density 1 is uniform."""
    log_none: float
    weight: float
    """What a logarithm of its density counts for."""
    up_a: Float[Array, "3"] | None
    up_b: Float[Array, "3"] | None

    @classmethod
    def of(cls, edge: RotationEdge, weight: float, upright: tuple[Upright | None, Upright | None]) -> "Mixture":
        """Compile an edge; `upright` of both of its shots."""
        probability = np.array([h.probability for h in edge.hypotheses])
        probability = probability * min(1.0, (1 - LEAST_NONE) / max(float(probability.sum()), 1e-9))
        sigma = np.radians([max(h.sigma_deg, 0.05) for h in edge.hypotheses]) / QUANTILE_68
        log_peak = np.log(np.maximum(probability, 1e-12)) + _LOG_T_PEAK + LOG_VOLUME - 3 * np.log(sigma)
        none = max(1 - float(probability.sum()), LEAST_NONE)
        R = np.stack([h.R_a_b for h in edge.hypotheses])
        return cls(
            edge,
            edge.a,
            edge.b,
            R,
            sigma,
            log_peak,
            math.log(none),
            weight,
            *(up.direction if up is not None else None for up in upright),
        )

    def components(self, R_a_b: Float[Array, "*n 3 3"]) -> Float[Array, "*n h+1"]:
        """Logarithm of each hypothesis' share of the density at a rotation, that of none of them last."""
        angle = rotation_angle(np.swapaxes(self.R, -1, -2) @ R_a_b[..., None, :, :])
        tail = np.log1p((angle / self.sigma) ** 2 / DEGREES_OF_FREEDOM)
        shares = self.log_peak - 0.5 * (DEGREES_OF_FREEDOM + 3) * tail
        return np.concatenate([shares, self._none(R_a_b)[..., None]], axis=-1)

    def likeliest(self, R_a_b: Float[Array, "3 3"]) -> int | None:
        """The hypothesis that a rotation most likely is; None where it is likelier none of them."""
        likeliest = int(self.components(R_a_b).argmax())
        return likeliest if likeliest < len(self.R) else None

    def _none(self, R_a_b: Float[Array, "*n 3 3"]) -> Float[Array, "*n"]:
        """Logarithm of the share of none of the hypotheses.

        Wrong rotations are not spread evenly: bodies stand and cameras are held level in all shots, so that most are
        rotations about the vertical. Two that are wrong agree by chance far more often than two random ones.
        """
        if self.up_a is None or self.up_b is None:
            return np.full(R_a_b.shape[:-2], self.log_none)
        kappa = 1 / math.radians(WRONG_TILT_DEG) ** 2
        cosine = (R_a_b @ self.up_b) @ self.up_a
        upright = 2 * kappa * np.exp(kappa * (cosine - 1))
        return np.asarray(self.log_none + np.log(WRONG_UPRIGHT * upright + 1 - WRONG_UPRIGHT))

    def log_density(self, shares: Float[Array, "*n h+1"]) -> Float[Array, "*n"]:
        """Logarithm of the density, as far as this edge is a witness of its own."""
        return np.asarray(self.weight * np.logaddexp.reduce(shares, axis=-1))

    def precision(self, shares: Float[Array, "*n h+1"]) -> tuple[Float[Array, "*n"], Float[Array, "*n"]]:
        """Expected inverse variance of the rotation, under the hypotheses in these shares: of all axes, and what comes
        to it of the two level axes."""
        weight = np.exp(shares - np.logaddexp.reduce(shares, axis=-1, keepdims=True))
        level = 0.0 if self.up_a is None or self.up_b is None else WRONG_UPRIGHT / math.radians(WRONG_TILT_DEG) ** 2
        return (weight[..., :-1] / self.sigma**2).sum(axis=-1), level * weight[..., -1]


def mixtures(edges: Sequence[RotationEdge], upright: Sequence[Upright | None]) -> list[Mixture]:
    """All edges between the shots of one world, compiled; `upright`: one a shot of the video."""
    return [
        Mixture.of(edge, weight, (upright[edge.a], upright[edge.b]))
        for edge, weight in zip(edges, _weights(edges), strict=True)
    ]


def _weights(edges: Sequence[RotationEdge]) -> list[float]:
    """How far each edge is a witness of its own.

    In a room whose walls are alike, a camera that is rotated by 90° sees what all other cameras see: the backgrounds of
    a shot agree with one another about the wrong rotation. All together they count for BACKGROUND_VOICES. Of pooled
    edges between n shots each counts for 2 / n.
    """
    degree: dict[int, int] = {}
    for edge in edges:
        if edge.num_inliers:
            degree[edge.a], degree[edge.b] = degree.get(edge.a, 0) + 1, degree.get(edge.b, 0) + 1
    pooled = {shot for edge in edges if edge.pooled for shot in (edge.a, edge.b)}
    weights = []
    for edge in edges:
        if edge.num_inliers:
            weights.append(min(1.0, BACKGROUND_VOICES / math.sqrt(degree[edge.a] * degree[edge.b])))
        else:
            weights.append(2 / len(pooled) if edge.pooled else 1.0)
    return weights


@dataclass(frozen=True, eq=False)
class Volume:
    """How far all rotations but the first are determined: precisions as Laplacians of the graph of shots."""

    every: Float[Array, "n shots shots"]
    """Of all three axes."""
    level: Float[Array, "n shots shots"]
    """What comes to it of the two level axes: rotations about them move the vertical."""

    def connect(self, a: int, b: int, every: Float[Array, " n"], level: Float[Array, " n"]) -> None:
        """Add the precision of an edge."""
        for laplacian, precision in ((self.every, every), (self.level, level)):
            for row, column, sign in ((a, a, 1), (b, b, 1), (a, b, -1), (b, a, -1)):
                laplacian[:, row, column] += sign * precision

    def log(self) -> Float[Array, " n"]:
        """Logarithm of the volume within which the rotations lie, as a fraction of all there are."""
        vertical, level = self.every[:, 1:, 1:], (self.every + self.level)[:, 1:, 1:]
        return log_volume(np.linalg.slogdet(vertical)[1], np.linalg.slogdet(level)[1], vertical.shape[1])


def log_volume(log_vertical: Float[Array, "*n"], log_level: Float[Array, "*n"], num: int = 1) -> Float[Array, "*n"]:
    """Logarithm of the volume of `num` normal rotations, as a fraction of all there are.

    `log_vertical` and `log_level` are the logarithms of the determinants of their precisions, about the vertical and
    about each level axis.
    """
    return np.asarray(num * (1.5 * math.log(2 * math.pi) - LOG_VOLUME) - 0.5 * log_vertical - log_level)
