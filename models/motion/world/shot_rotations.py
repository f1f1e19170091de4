"""One rotation per shot, decided over the whole video from everything that speaks of it.

Every piece of evidence is an edge of a graph whose nodes are shots: people at a cut (`cuts`), or a background that two
shots share (`camera.background`). An edge does not give a rotation but a mixture of hypotheses (left and right as
found or swapped, both rotations that explain a plane, the essential matrix) and a probability that none of them is
true. No edge is believed alone, however certain it is of itself: the rotations of all shots are those in which all
edges and gravity together have the largest posterior probability, found by a beam search over the hypotheses
along a spanning tree and then by rotation averaging (Hartley et al., IJCV 2013) over the hypotheses chosen.

How certain a rotation is follows from what the evidence allows besides: the probability of the alternatives that
rotate one shot, or all shots after a cut.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from humanmm.models.geometry.rotations import rotation_angle, rotmat_to_rotvec, rotvec_to_rotmat

Array = np.ndarray

BEAM = 48
"""Joint hypotheses that are kept from shot to shot."""
DISTINCT_DEG = 3.0
"""Joint hypotheses whose newest rotations differ by less are one."""
ELSEWHERE_DEG = 15.0
"""Rotations further apart than this are different answers, not the same one with an error."""
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
ITERATIONS = 20
REFINED = 6
"""So many alternatives at a cut, the likeliest, are averaged before they are weighed."""
MOVES = 20
"""Largest number of single changes after the beam search."""

_LOG_VOLUME = math.log(8 * math.pi**2)
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


@dataclass(frozen=True)
class Upright:
    """Where up is in a shot's own axes."""

    direction: Float[Array, "3"]
    sigma_deg: float


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
class Certainty:
    """How certain the rotation between two neighbouring shots is."""

    sigma_deg: float
    """The true rotation lies within this angle with a probability of 68 %."""
    probability: float
    """That the rotation is the right one of all that the evidence allows."""


@dataclass(frozen=True)
class ShotRotations:
    """Rotations of all shots, shot b's axes to those of the first shot of its group."""

    R_group_shot: Float[Array, "shots 3 3"]
    group: tuple[int, ...]
    """First shot of the connected group that a shot belongs to."""
    believed: tuple[Believed, ...]
    refused: tuple[Refused, ...]
    certainty: tuple[Certainty | None, ...]
    """Of each shot's rotation against the shot before; None for the first, and where the two are not connected."""


def solve_rotations(
    num_shots: int, edges: Sequence[RotationEdge], upright: Sequence[Upright | None] = ()
) -> ShotRotations:
    """Rotations of all shots from all edges together; `upright`: one a shot, or none at all."""
    ups = [*upright, *[None] * (num_shots - len(upright))]
    usable = [edge for edge in edges if edge.hypotheses]
    compiled = [
        _Compiled.of(edge, weight, (ups[edge.a], ups[edge.b]))
        for edge, weight in zip(usable, _weights(usable), strict=True)
    ]
    R, group = np.tile(np.eye(3), (num_shots, 1, 1)), list(range(num_shots))
    certainty: list[Certainty | None] = [None] * num_shots
    for shots in _groups(num_shots, compiled):
        own = [edge for edge in compiled if edge.a in shots and edge.b in shots]
        world = _Group(shots, own, [ups[shot] for shot in shots])
        found = world.solve()
        for shot, rotation in zip(shots, found, strict=True):
            R[shot], group[shot] = found[0].T @ rotation, shots[0]
        for shot, one in world.certainty(found).items():
            certainty[shot] = one
    believed, refused = _sorted_out(R, group, compiled)
    return ShotRotations(R, tuple(group), believed, refused, tuple(certainty))


@dataclass(frozen=True, eq=False)
class _Compiled:
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
    def of(cls, edge: RotationEdge, weight: float, upright: tuple[Upright | None, Upright | None]) -> "_Compiled":
        probability = np.array([h.probability for h in edge.hypotheses])
        probability = probability * min(1.0, (1 - LEAST_NONE) / max(float(probability.sum()), 1e-9))
        sigma = np.radians([max(h.sigma_deg, 0.05) for h in edge.hypotheses]) / QUANTILE_68
        log_peak = np.log(np.maximum(probability, 1e-12)) + _LOG_T_PEAK + _LOG_VOLUME - 3 * np.log(sigma)
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
        return self.weight * _log_sum(shares)

    def precision(self, shares: Float[Array, "*n h+1"]) -> tuple[Float[Array, "*n"], Float[Array, "*n"]]:
        """Expected inverse variance of the rotation, under the hypotheses in these shares: of all axes, and what comes
        to it of the two level axes."""
        weight = np.exp(shares - _log_sum(shares)[..., None])
        level = 0.0 if self.up_a is None or self.up_b is None else WRONG_UPRIGHT / math.radians(WRONG_TILT_DEG) ** 2
        return (weight[..., :-1] / self.sigma**2).sum(axis=-1), level * weight[..., -1]


def _weights(edges: Sequence[RotationEdge]) -> list[float]:
    """How far each edge is a witness of its own.

    In a room whose walls are alike, a camera that is rotated by 90° sees what all other cameras see: the backgrounds of
    a shot agree with one another about the wrong rotation. All together they count for BACKGROUND_VOICES.
    """
    degree: dict[int, int] = {}
    for edge in edges:
        if edge.num_inliers:
            degree[edge.a], degree[edge.b] = degree.get(edge.a, 0) + 1, degree.get(edge.b, 0) + 1
    return [
        min(1.0, BACKGROUND_VOICES / math.sqrt(degree[edge.a] * degree[edge.b])) if edge.num_inliers else 1.0
        for edge in edges
    ]


def _log_sum(x: Float[Array, "*n h"]) -> Float[Array, "*n"]:
    top = x.max(axis=-1)
    return np.asarray(top + np.log(np.exp(x - top[..., None]).sum(axis=-1)))


def _groups(num_shots: int, edges: Sequence[_Compiled]) -> list[list[int]]:
    """Shots that edges connect, each group in order."""
    root = list(range(num_shots))

    def find(shot: int) -> int:
        while root[shot] != shot:
            shot = root[shot]
        return shot

    for edge in edges:
        if edge.edge.connects:
            first, second = sorted((find(edge.a), find(edge.b)))
            root[second] = first
    groups: dict[int, list[int]] = {}
    for shot in range(num_shots):
        groups.setdefault(find(shot), []).append(shot)
    return list(groups.values())


class _Group:
    """The connected shots of one world."""

    def __init__(self, shots: Sequence[int], edges: Sequence[_Compiled], upright: Sequence[Upright | None]) -> None:
        self.shots = list(shots)
        index = {shot: k for k, shot in enumerate(shots)}
        self.edges = [(edge, index[edge.a], index[edge.b]) for edge in edges]
        self.kappa = np.array([1 / math.radians(up.sigma_deg) ** 2 if up is not None else 0.0 for up in upright])
        self.up = np.stack([up.direction if up is not None else np.zeros(3) for up in upright])

    def solve(self) -> Float[Array, "shots 3 3"]:
        """The rotations of largest posterior probability, the first shot's the identity."""
        states = self._beam()
        refined = [self._averaged(R) for R in states[:4]]
        best = max(refined, key=lambda R: float(self._score(R[None])[0]))
        for _ in range(MOVES):
            moved = [R for k in range(1, len(self.shots)) for _, R in self._alternatives(best, k)]
            if not moved:
                break
            scores = self._score(np.stack(moved))
            if scores.max() <= float(self._score(best[None])[0]) + 1e-6:
                break
            best = self._averaged(moved[int(scores.argmax())])
        return best

    # ---- how good rotations are

    def _score(self, R: Float[Array, "n shots 3 3"]) -> Float[Array, " n"]:
        """Logarithm of the posterior probability near each set of rotations: what the edges and gravity say there,
        times the volume within which they say it (else the more precise of two hypotheses would always win)."""
        total, volume = self._gravity(R), self._volume(len(R))
        for edge, a, b in self.edges:
            shares = edge.components(np.swapaxes(R[:, a], -1, -2) @ R[:, b])
            total = total + edge.log_density(shares)
            volume.connect(a, b, *edge.precision(shares))
        return np.asarray(total + volume.log())

    def _volume(self, n: int) -> "_Volume":
        """Before any edge: what gravity says, and nothing else."""
        unknown = np.tile(UNKNOWN_PRECISION * np.eye(len(self.shots)), (n, 1, 1))
        return _Volume(unknown, np.tile(np.diag(self.kappa), (n, 1, 1)))

    def _gravity(self, R: Float[Array, "n shots 3 3"]) -> Float[Array, " n"]:
        """How well the shots' own verticals agree (von Mises-Fisher; the vertical itself is integrated out)."""
        known = self.kappa > 0
        if known.sum() < 2:
            return np.zeros(len(R))
        kappa = self.kappa[known]
        mean = np.einsum("s,nsab,sb->na", kappa, R[:, known], self.up[known])
        return np.asarray(_log_sinhc(np.linalg.norm(mean, axis=1)) - _log_sinhc(kappa).sum())

    # ---- search

    def _order(self) -> list[int]:
        """The shots in an order in which each is connected to one before, the surest connections first."""
        order, done = [0], {0}
        while len(order) < len(self.shots):
            open_edges = [
                (float(edge.log_peak.max()), -max(a, b), a if b in done else b)
                for edge, a, b in self.edges
                if (a in done) != (b in done) and (edge.edge.connects)
            ]
            _, _, node = max(open_edges)
            order.append(node)
            done.add(node)
        return order

    def _beam(self) -> list[Float[Array, "shots 3 3"]]:
        """The best joint hypotheses, best first."""
        R = np.tile(np.eye(3), (1, len(self.shots), 1, 1))
        score = np.zeros(1)
        kappa_mean = self.kappa[0] * self.up[0][None]
        done = [0]
        for node in self._order()[1:]:
            meeting = [(edge, a, b) for edge, a, b in self.edges if node in (a, b) and (a if b == node else b) in done]
            proposals = []
            for edge, a, b in meeting:
                if b == node:
                    proposals.append(R[:, None, a] @ edge.R)
                else:
                    proposals.append(R[:, None, b] @ np.swapaxes(edge.R, -1, -2))
            candidates = np.concatenate(proposals, axis=1)
            gained = np.zeros(candidates.shape[:2])
            every, level = np.full_like(gained, UNKNOWN_PRECISION), np.full_like(gained, self.kappa[node])
            for edge, a, b in meeting:
                other = R[:, a if b == node else b][:, None]
                relative = np.swapaxes(other, -1, -2) @ candidates
                shares = edge.components(relative if b == node else np.swapaxes(relative, -1, -2))
                gained += edge.log_density(shares)
                own_every, own_level = edge.precision(shares)
                every, level = every + own_every, level + own_level
            mean = kappa_mean[:, None] + self.kappa[node] * candidates @ self.up[node]
            if self.kappa[node] and np.any(kappa_mean):
                length, before = np.linalg.norm(mean, axis=-1), np.linalg.norm(kappa_mean, axis=-1)[:, None]
                own = _log_sinhc(np.array([self.kappa[node]]))[0]
                gained += _log_sinhc(length) - _log_sinhc(before) - own
            volume = 1.5 * math.log(2 * math.pi) - _LOG_VOLUME - 0.5 * np.log(every) - np.log(every + level)
            total = score[:, None] + gained + volume
            chosen = _distinct(total, candidates)
            parent, child = chosen
            R, score, kappa_mean = R[parent], total[parent, child], mean[parent, child]
            R[:, node] = candidates[parent, child]
            done.append(node)
        return list(R)

    def _alternatives(
        self, R: Float[Array, "shots 3 3"], k: int
    ) -> Iterator[tuple[Float[Array, "3 3"], Float[Array, "shots 3 3"]]]:
        """Other rotations at the cut before the group's shot k: all shots from k on rotated alike, shot k alone, or
        shot k - 1 alone, as a hypothesis of an edge has it. Gives the new relative rotation with all rotations."""
        everything = np.arange(len(R))
        for moving in (everything >= k, everything == k, everything == k - 1):
            if moving[0] and moving.sum() == 1:
                continue
            for edge, a, b in self.edges:
                if moving[a] == moving[b]:
                    continue
                for R_a_b in edge.R:
                    step = R[a] @ R_a_b @ R[b].T if moving[b] else R[b] @ R_a_b.T @ R[a].T
                    if float(rotation_angle(step)) < np.radians(DISTINCT_DEG):
                        continue
                    moved = R.copy()
                    moved[moving] = step @ R[moving]
                    yield moved[k - 1].T @ moved[k], moved

    # ---- rotation averaging

    def _averaged(self, R: Float[Array, "shots 3 3"]) -> Float[Array, "shots 3 3"]:
        """The nearest maximum of the posterior: Gauss-Newton on the hypotheses in their present shares."""
        for _ in range(ITERATIONS):
            H, g = self._normal(R)
            step = np.zeros((len(R), 3))
            if len(R) > 1:
                step[1:] = -np.linalg.solve(H[3:, 3:] + 1e-6 * np.eye(3 * len(R) - 3), g[3:]).reshape(-1, 3)
            length = np.linalg.norm(step, axis=1, keepdims=True)
            step *= np.minimum(1.0, 0.3 / np.maximum(length, 1e-12))
            R = R @ rotvec_to_rotmat(step)
            if np.abs(step).max() < 1e-9:
                break
        return R

    def _normal(self, R: Float[Array, "shots 3 3"]) -> tuple[Float[Array, "n n"], Float[Array, " n"]]:
        """Gauss-Newton matrix and gradient, of rotation vectors on the right of R.

        Residual of a hypothesis: log(R_a_bᵀ R_aᵀ R_b); to first order it changes by δ_b − (R_bᵀ R_a) δ_a.
        """
        num = len(R)
        H, g = np.zeros((num, 3, num, 3)), np.zeros((num, 3))
        for edge, a, b in self.edges:
            relative = R[a].T @ R[b]
            shares = edge.components(relative)
            share = np.exp(shares - _log_sum(shares))[:-1]
            residual = rotmat_to_rotvec(np.swapaxes(edge.R, -1, -2) @ relative)
            squared = (residual**2).sum(axis=1) / edge.sigma**2
            # weight of the t distribution (Lange, Little and Taylor 1989)
            weight = share * (DEGREES_OF_FREEDOM + 3) / (DEGREES_OF_FREEDOM + squared) / edge.sigma**2
            blocks = {a: -R[b].T @ R[a], b: np.eye(3)}
            for i, J_i in blocks.items():
                g[i] += J_i.T @ (weight @ residual)
                for j, J_j in blocks.items():
                    H[i, :, j] += weight.sum() * J_i.T @ J_j
        return H.reshape(3 * num, 3 * num), g.ravel()

    # ---- how certain they are

    def certainty(self, R: Float[Array, "shots 3 3"]) -> dict[int, Certainty]:
        """Of the rotation between every two neighbouring shots of the group, by the later one."""
        if len(R) < 2:
            return {}
        H, _ = self._normal(R)
        covariance = np.zeros((3 * len(R), 3 * len(R)))
        covariance[3:, 3:] = np.linalg.inv(H[3:, 3:] + 1e-3 * np.eye(3 * len(R) - 3))
        here = float(self._score(R[None])[0])
        found = {}
        for k in range(1, len(R)):
            if self.shots[k] != self.shots[k - 1] + 1:
                continue
            J = np.zeros((3, 3 * len(R)))
            J[:, 3 * k - 3 : 3 * k], J[:, 3 * k : 3 * k + 3] = -R[k].T @ R[k - 1], np.eye(3)
            sigma_deg = QUANTILE_68 * float(np.degrees(np.sqrt(np.trace(J @ covariance @ J.T) / 3)))
            found[self.shots[k]] = self._with_alternatives(R, k, sigma_deg, here)
        return found

    def _with_alternatives(self, R: Float[Array, "shots 3 3"], k: int, sigma_deg: float, here: float) -> Certainty:
        """The error that 68 % stay below: of the rotation chosen, and of the others by their probabilities."""
        chosen, elsewhere = R[k - 1].T @ R[k], np.radians(ELSEWHERE_DEG)
        others = [one for one in self._alternatives(R, k) if float(rotation_angle(chosen.T @ one[0])) > elsewhere]
        modes: list[tuple[Array, float]] = []
        if others:
            scores = self._score(np.stack([moved for _, moved in others]))
            for which in np.argsort(-scores)[:REFINED]:
                moved = self._averaged(others[which][1])
                relative = moved[k - 1].T @ moved[k]
                apart = [chosen, *(mode for mode, _ in modes)]
                if all(float(rotation_angle(one.T @ relative)) > elsewhere for one in apart):
                    modes.append((relative, float(np.exp(min(float(self._score(moved[None])[0]) - here, 0.0)))))
        total = 1.0 + sum(weight for _, weight in modes)
        # Beyond all hypotheses: every edge across the cut is wrong.
        nowhere = float(np.exp(self._score_without(R, k) - here))
        total += nowhere
        angles = [float(np.degrees(rotation_angle(chosen.T @ mode))) for mode, _ in modes]
        weights = [1.0, *(weight for _, weight in modes), nowhere]
        grid = np.linspace(0.1, 180.0, 1800)
        inside = np.zeros(len(grid))
        for centre, weight in zip([0.0, *angles], weights[:-1], strict=True):
            inside += weight / total * _normal_inside(grid - centre if centre else grid, sigma_deg, bool(centre))
        inside += nowhere / total * (np.radians(grid) - np.sin(np.radians(grid))) / np.pi
        reached = np.flatnonzero(inside >= 0.68)
        return Certainty(float(grid[reached[0]]) if len(reached) else 180.0, 1.0 / total)

    def _score_without(self, R: Float[Array, "shots 3 3"], k: int) -> float:
        """The same score if none of the hypotheses of any edge across the cut were true."""
        total = float(self._gravity(R[None])[0]) if len(R) > 2 else 0.0
        volume = self._volume(1)
        for edge, a, b in self.edges:
            if (a < k) != (b < k):
                total += edge.weight * edge.log_none  # anywhere
                continue
            shares = edge.components((R[a].T @ R[b])[None])
            total += float(edge.log_density(shares)[0])
            volume.connect(a, b, *edge.precision(shares))
        return total + float(volume.log()[0])


@dataclass(frozen=True, eq=False)
class _Volume:
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
        determinant = 0.5 * np.linalg.slogdet(vertical)[1] + np.linalg.slogdet(level)[1]
        return np.asarray(vertical.shape[1] * (1.5 * math.log(2 * math.pi) - _LOG_VOLUME) - determinant)


def _normal_inside(angle: Float[Array, " n"], sigma_deg: float, distant: bool) -> Float[Array, " n"]:
    """Fraction of normal rotation errors below an angle; for a distant mode, of one axis about its distance."""
    s = max(sigma_deg, 0.1) / QUANTILE_68
    z = angle / s
    if distant:
        return np.asarray(0.5 * (1 + np.tanh(0.8 * z)))
    erf = np.vectorize(math.erf)
    return np.asarray(erf(z / math.sqrt(2)) - math.sqrt(2 / math.pi) * z * np.exp(-(z**2) / 2))


def _log_sinhc(x: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """log(sinh(x) / x)."""
    x = np.maximum(x, 1e-6)
    return np.asarray(x + np.log1p(-np.exp(-2 * x)) - np.log(2 * x))


def _distinct(score: Float[Array, "n c"], R: Float[Array, "n c 3 3"]) -> tuple[list[int], list[int]]:
    """The best BEAM pairs of parent and candidate; of one parent's candidates that are nearly equal the best."""
    parents: list[int] = []
    children: list[int] = []
    for flat in np.argsort(-score, axis=None, kind="stable"):
        n, c = divmod(int(flat), score.shape[1])
        near = [children[i] for i in range(len(parents)) if parents[i] == n]
        if any(float(rotation_angle(R[n, one].T @ R[n, c])) < np.radians(DISTINCT_DEG) for one in near):
            continue
        parents.append(n)
        children.append(c)
        if len(parents) == BEAM:
            break
    return parents, children


def _sorted_out(
    R: Float[Array, "shots 3 3"], group: Sequence[int], edges: Sequence[_Compiled]
) -> tuple[tuple[Believed, ...], tuple[Refused, ...]]:
    """The edges of which a hypothesis is likelier than none, with that hypothesis, and the others."""
    believed: list[Believed] = []
    refused: list[Refused] = []
    for edge in edges:
        if group[edge.a] != group[edge.b]:
            refused.append(Refused(edge.edge, float("nan")))
            continue
        relative = R[edge.a].T @ R[edge.b]
        shares = edge.components(relative)
        likeliest = int(shares.argmax())
        if likeliest < len(edge.R):
            believed.append(Believed(edge.edge, edge.edge.hypotheses[likeliest]))
        else:
            off = rotation_angle(np.swapaxes(edge.R, -1, -2) @ relative)
            refused.append(Refused(edge.edge, float(np.degrees(off.min()))))
    return tuple(believed), tuple(refused)
