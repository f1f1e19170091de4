"""What one piece of evidence says of the rotation between two shots: a mixture of hypotheses, and of none of them.

A hypothesis' errors follow a t distribution; where none is true the rotation may be any, though most wrong ones are
rotations about the vertical. Densities are relative to that of all rotations being equally likely.
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import csr_array

from humanmm.models.geometry.rotations import rotation_distance

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
COMPARE_ALL, NEIGHBOURS = 8, 3
"""Of up to so many shots that show something, any two are compared; of more each with so many after it: the time of a
solve grows with the square of the edges at least."""
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
    """Made of what each of the two shots says by itself: however many pairs of n shots there are, they know no more
    than n - 1 of them."""

    def silent(self) -> "RotationEdge":
        """The same connection, of whose hypotheses none is believed."""
        return replace(self, hypotheses=tuple(replace(one, probability=0.0) for one in self.hypotheses))


@dataclass(frozen=True)
class Believed:
    """An edge, and the hypothesis of it that was chosen."""

    edge: RotationEdge
    hypothesis: RotationHypothesis


@dataclass(frozen=True)
class Refused:
    """An edge of which no hypothesis agrees with all the rest."""

    edge: RotationEdge
    off_deg: float
    """How far its nearest hypothesis is from the rotation that was chosen; nan where nothing else was known."""


@dataclass(frozen=True)
class Upright:
    """Where up is in a shot's own axes."""

    direction: Float[Array, "3"]
    sigma_deg: float


@dataclass(frozen=True, eq=False)
class Shares:
    """Logarithms of what has a part in the densities of E edges with H hypotheses, at some rotations."""

    hypotheses: Float[Array, "*n H"]
    none: Float[Array, "*n E"]
    """Of none of an edge's hypotheses."""
    density: Float[Array, "*n E"]
    """Of all together."""


@dataclass(frozen=True, eq=False)
class Mixtures:
    """E edges between the shots of one world, each with a hypothesis or more; all H hypotheses in one row."""

    edges: tuple[RotationEdge, ...]
    weight: Float[Array, " E"]
    """What a logarithm of an edge's density counts for."""
    log_none: Float[Array, " E"]
    up: Float[Array, "2 E 3"]
    """Where up is in the edge's shots a and b; 0 where that is not known of both."""
    of_edge: Int[Array, " H"]
    """The edge of each hypothesis; those of one edge stand together."""
    R: Float[Array, "H 3 3"]
    sigma: Float[Array, " H"]
    """Standard deviation of one axis, radians."""
    log_peak: Float[Array, " H"]
    """Logarithm of a hypothesis' density at its own rotation, times its probability; density 1 is uniform."""

    @classmethod
    def of(cls, edges: Sequence[RotationEdge], upright: Sequence[Upright | None]) -> "Mixtures":
        """Compile edges; `upright`: one a shot of the video."""
        hypotheses = [one for edge in edges for one in edge.hypotheses]
        of_edge = np.repeat(np.arange(len(edges)), [len(edge.hypotheses) for edge in edges])
        probability = np.array([one.probability for one in hypotheses])
        total = np.bincount(of_edge, probability, len(edges))
        fraction = np.minimum(1.0, (1 - LEAST_NONE) / np.maximum(total, 1e-9))
        sigma = np.radians([max(one.sigma_deg, 0.05) for one in hypotheses]) / QUANTILE_68
        log_probability = np.log(np.maximum(fraction[of_edge] * probability, 1e-12))
        return cls(
            edges=tuple(edges),
            weight=np.array(_weights(edges)),
            log_none=np.log(np.maximum(1 - fraction * total, LEAST_NONE)),
            up=np.array([_both_up(upright[edge.a], upright[edge.b]) for edge in edges])
            .reshape(-1, 2, 3)
            .swapaxes(0, 1),
            of_edge=of_edge,
            R=np.array([one.R_a_b for one in hypotheses]).reshape(-1, 3, 3),
            sigma=sigma,
            log_peak=log_probability + _LOG_T_PEAK + LOG_VOLUME - 3 * np.log(sigma),
        )

    def some(self, chosen: Int[Array, " e"]) -> "Mixtures":
        """Some of the edges, in order."""
        kept = np.isin(self.of_edge, chosen)
        return Mixtures(
            tuple(self.edges[k] for k in chosen), self.weight[chosen], self.log_none[chosen], self.up[:, chosen],
            np.searchsorted(chosen, self.of_edge[kept]), self.R[kept], self.sigma[kept], self.log_peak[kept],
        )  # fmt: skip

    @cached_property
    def first(self) -> Int[Array, " E"]:
        """Each edge's first hypothesis."""
        return np.searchsorted(self.of_edge, np.arange(len(self.edges)))

    def shares(self, R_a_b: Float[Array, "*n E 3 3"]) -> Shares:
        """What the edges and their hypotheses say of a rotation for each edge."""
        angle = rotation_distance(self.R, R_a_b[..., self.of_edge, :, :])
        tail = np.log1p((angle / self.sigma) ** 2 / DEGREES_OF_FREEDOM)
        hypotheses = self.log_peak - 0.5 * (DEGREES_OF_FREEDOM + 3) * tail
        none = self._none(R_a_b)
        return Shares(hypotheses, none, np.logaddexp(np.logaddexp.reduceat(hypotheses, self.first, axis=-1), none))

    def believed(self, shares: Shares) -> Bool[Array, "*n E"]:
        """The edges of which a hypothesis is likelier than none."""
        return np.asarray(np.maximum.reduceat(shares.hypotheses, self.first, axis=-1) >= shares.none)

    def _none(self, R_a_b: Float[Array, "*n E 3 3"]) -> Float[Array, "*n E"]:
        """Logarithm of the share of none of the hypotheses.

        Wrong rotations are not spread evenly: bodies stand and cameras are held level in all shots, so that most are
        rotations about the vertical. Two that are wrong agree by chance far more often than two random ones.
        """
        kappa = 1 / math.radians(WRONG_TILT_DEG) ** 2
        cosine = np.einsum("ea,...eab,eb->...e", self.up[0], R_a_b, self.up[1])
        upright = np.where(self.up[0].any(axis=-1), 2 * kappa * np.exp(kappa * (cosine - 1)), 1.0)
        return np.asarray(self.log_none + np.log(WRONG_UPRIGHT * upright + 1 - WRONG_UPRIGHT))

    def log_density(self, shares: Shares) -> Float[Array, "*n"]:
        """Logarithm of the density of all edges, as far as each is a witness of its own."""
        return np.asarray(shares.density @ self.weight)

    def precision(self, shares: Shares) -> tuple[Float[Array, "*n E"], Float[Array, "*n E"]]:
        """Expected inverse variance of each edge's rotation, under its hypotheses in these shares: of all axes, and
        what comes to it of the two level axes."""
        fraction = np.exp(shares.hypotheses - shares.density[..., self.of_edge])
        level = np.where(self.up[0].any(axis=-1), WRONG_UPRIGHT / math.radians(WRONG_TILT_DEG) ** 2, 0.0)
        every = np.add.reduceat(fraction / self.sigma**2, self.first, axis=-1)
        return every, level * np.exp(shares.none - shares.density)


def compared(shots: Sequence[int]) -> list[tuple[int, int]]:
    """The pairs of shots, given in order, which what each of them shows makes edges of."""
    reach = len(shots) if len(shots) <= COMPARE_ALL else NEIGHBOURS
    return [(a, b) for k, a in enumerate(shots) for b in shots[k + 1 : k + 1 + reach]]


def _both_up(a: Upright | None, b: Upright | None) -> Float[Array, "2 3"]:
    return np.zeros((2, 3)) if a is None or b is None else np.stack([a.direction, b.direction])


def _weights(edges: Sequence[RotationEdge]) -> list[float]:
    """How far each edge is a witness of its own.

    In a room whose walls are alike, a camera that is rotated by 90° sees what all other cameras see: the backgrounds of
    a shot agree with one another about the wrong rotation. All together they count for BACKGROUND_VOICES. Pooled
    edges of one source between n shots count for n - 1 together.
    """
    degree: dict[int, int] = {}
    for edge in edges:
        if edge.num_inliers:
            degree[edge.a], degree[edge.b] = degree.get(edge.a, 0) + 1, degree.get(edge.b, 0) + 1
    shots: dict[str, set[int]] = {}
    for edge in edges:
        if edge.pooled:
            shots.setdefault(edge.source, set()).update((edge.a, edge.b))
    count = Counter(edge.source for edge in edges if edge.pooled)
    weights = []
    for edge in edges:
        if edge.num_inliers:
            weights.append(min(1.0, BACKGROUND_VOICES / math.sqrt(degree[edge.a] * degree[edge.b])))
        else:
            weights.append((len(shots[edge.source]) - 1) / count[edge.source] if edge.pooled else 1.0)
    return weights


def laplacian(ends: Int[Array, "E 2"], weight: Float[Array, "*n E"], num: int) -> Float[Array, "*n num num"]:
    """Σ w (x_a − x_b)² over the edges of a graph, as a quadratic form of x: precisions of edges as one of shots."""
    a, b = ends.T
    rows, signs = (
        np.concatenate([a * num + a, b * num + b, a * num + b, b * num + a]),
        np.repeat([1.0, -1.0], 2 * len(a)),
    )
    of_edges = csr_array((signs, (rows, np.tile(np.arange(len(a)), 4))), shape=(num * num, len(a)))
    return np.asarray((of_edges @ weight.reshape(-1, len(a)).T).T.reshape(*weight.shape[:-1], num, num))


def log_graph_volume(
    every: Float[Array, "*n shots shots"], level: Float[Array, "*n shots shots"]
) -> Float[Array, "*n"]:
    """Logarithm of the volume within which all rotations but the first lie, as a fraction of all there are.

    `every`: precisions of all three axes; `level`: what comes to them of the two level axes, rotations about which move
    the vertical.
    """
    vertical, level = every[..., 1:, 1:], (every + level)[..., 1:, 1:]
    return log_volume(np.linalg.slogdet(vertical)[1], np.linalg.slogdet(level)[1], vertical.shape[-1])


def log_volume(log_vertical: Float[Array, "*n"], log_level: Float[Array, "*n"], num: int = 1) -> Float[Array, "*n"]:
    """Logarithm of the volume of `num` normal rotations, as a fraction of all there are.

    `log_vertical` and `log_level` are the logarithms of the determinants of their precisions, about the vertical and
    about each level axis.
    """
    return np.asarray(num * (1.5 * math.log(2 * math.pi) - LOG_VOLUME) - 0.5 * log_vertical - log_level)
