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
from jaxtyping import Float, Int
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.special import erf

from humanmm.models.geometry.rotations import (
    nearest_rotation,
    rotation_angle,
    rotation_distance,
    rotmat_to_rotvec,
    rotvec_to_rotmat,
    swing,
    unit,
)
from humanmm.models.motion.rotations.rotation_mixtures import (
    DEGREES_OF_FREEDOM,
    QUANTILE_68,
    UNKNOWN_PRECISION,
    Believed,
    Mixtures,
    Refused,
    RotationEdge,
    RotationHypothesis,
    Shares,
    Upright,
    laplacian,
    log_graph_volume,
    log_volume,
)
from humanmm.models.motion.rotations.verticals import WRONG, Verticals, curvature, log_sinhc

Array = np.ndarray

BEAM = 48
"""Joint hypotheses that are kept from shot to shot."""
DISTINCT_DEG = 3.0
"""Joint hypotheses whose newest rotations differ by less are one."""
ELSEWHERE_DEG = 15.0
"""Rotations further apart than this are different answers, not the same one with an error."""
ITERATIONS, CONVERGED_RAD = 20, 1e-4
REFINED, REFINING = 12, 4
"""So many alternatives at a cut, the likeliest, are averaged for so many iterations before they are weighed."""
MOVES = 20
"""Largest number of single changes after the beam search."""
LEAST_GAIN = 1e-6
"""Of a change, in the logarithm of the posterior probability."""
EVIDENCE_COUNTS, LEFT_OPEN, SPREAD = 0.5, 0.03, 1.4
"""How far evidence says how certain it is. Witnesses of one video share their errors (a pose network's bias, walls that
are alike), so that logarithms of odds count by half; a rotation may be wrong in a way that no witness shows; errors
about a right rotation are larger than the witnesses' own. Measured on 192 cuts of 116 clips
(docs/measurements/cuts.md)."""
SHARED_DEG = 1.5
"""Error that all witnesses of a rotation have in common, however many there are: focal length, lens, verticals. With it
95 % of 168 development rotations of `standard` clips lie within two stated deviations, 92 without."""
AT_ONCE = 200_000
"""Hypotheses that are weighed together: so many rotation matrices take 14 MB."""


@dataclass(frozen=True)
class Certainty:
    """How certain the rotation between two neighbouring shots is."""

    sigma_deg: float
    """The true rotation lies within this angle with a probability of 68 %."""
    within_95_deg: float
    """The same with a probability of 95 %: far more than twice as large where another answer is likely."""
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
    """Of each shot's rotation against the shot of its group before it; None for a group's first."""


def solve_rotations(
    num_shots: int, edges: Sequence[RotationEdge], upright: Sequence[Upright | None] = ()
) -> ShotRotations:
    """Rotations of all shots from all edges together; `upright`: one a shot, or none at all."""
    ups = [*upright, *[None] * (num_shots - len(upright))]
    usable = [edge for edge in edges if edge.hypotheses]
    R, group = np.tile(np.eye(3), (num_shots, 1, 1)), list(range(num_shots))
    certainty: list[Certainty | None] = [None] * num_shots
    believed: list[Believed] = []
    refused: list[Refused] = []
    for shots in _groups(num_shots, usable):
        own = [edge for edge in usable if edge.a in shots and edge.b in shots]
        if not own:
            continue
        world = _Group(shots, Mixtures.of(own, ups), [ups[shot] for shot in shots])
        found = world.solve()
        for shot, rotation in zip(shots, found, strict=True):
            R[shot], group[shot] = found[0].T @ rotation, shots[0]
        for shot, one in world.certainty(found).items():
            certainty[shot] = one
        for edge, verdict in world.sorted_out(found):
            if isinstance(verdict, RotationHypothesis):
                believed.append(Believed(edge, verdict))
            else:
                refused.append(Refused(edge, verdict))
    between = [Refused(edge, float("nan")) for edge in usable if group[edge.a] != group[edge.b]]
    return ShotRotations(R, tuple(group), tuple(believed), (*refused, *between), tuple(certainty))


def _groups(num_shots: int, edges: Sequence[RotationEdge]) -> list[list[int]]:
    """Shots that edges connect, each group in order."""
    labels = _connected(num_shots, [(edge.a, edge.b) for edge in edges if edge.connects])
    groups: dict[int, list[int]] = {}
    for shot, label in enumerate(labels):
        groups.setdefault(label, []).append(shot)
    return list(groups.values())


def _connected(num_shots: int, pairs: Sequence[tuple[int, int]] | Int[Array, "n 2"]) -> list[int]:
    """A number for each shot, the same for all that pairs of them join."""
    a, b = np.array(pairs, int).reshape(-1, 2).T
    graph = csr_array((np.ones(len(a)), (a, b)), shape=(num_shots, num_shots))
    return [int(label) for label in connected_components(graph, directed=False)[1]]


class _Group:
    """The connected shots of one world: S of them, with E edges of H hypotheses."""

    def __init__(self, shots: Sequence[int], edges: Mixtures, upright: Sequence[Upright | None]) -> None:
        self.shots, self.edges = list(shots), edges
        self.ends = np.searchsorted(shots, np.array([(edge.a, edge.b) for edge in edges.edges]))
        self.upright = Verticals.of(upright)

    def solve(self) -> Float[Array, "S 3 3"]:
        """The rotations of largest posterior probability, the first shot's the identity."""
        best = self._averaged(self._best(self._averaged(self._with_level(self._beam()[:4]), REFINING))[None])[0]
        for _ in range(MOVES):
            moved = (self._alternatives(best, k) for k in range(1, len(self.shots)))
            found = np.stack([self._best(np.concatenate([best[None], other])) for other in moved])
            level = self._averaged(self._with_level(np.concatenate([best[None], found])), REFINING)
            better = self._best(np.concatenate([best[None], found, level]))
            if self._score(better[None])[0] < self._score(best[None])[0] + LEAST_GAIN:
                break
            best = self._averaged(better[None])[0]
        return np.asarray(best)

    def _with_level(self, R: Float[Array, "n S 3 3"]) -> Float[Array, "2n S 3 3"]:
        """These, and the same with every shot's own vertical turned onto the mean of all."""
        up, mean = self._verticals(R, self.upright.kappa)
        return np.concatenate([R, swing(up, np.broadcast_to(mean, up.shape)) @ R])

    def _verticals(
        self, R: Float[Array, "n S 3 3"], kappa: Float[Array, "*n S"]
    ) -> tuple[Float[Array, "n S 3"], Float[Array, "n 1 3"]]:
        """The verticals of all shots in the axes of the group, and their mean by these concentrations."""
        up = np.einsum("nsab,sb->nsa", R, self.upright.up)
        return up, unit((kappa[..., None] * up).sum(axis=1, keepdims=True))

    def _best(self, R: Float[Array, "n S 3 3"]) -> Float[Array, "S 3 3"]:
        """The likeliest of these in which evidence that is believed joins all shots; without any, the likeliest.

        Where it is likelier that nothing is true than that any one thing is, that nothing is true is no answer.
        """
        order = np.argsort(-self._score(R), kind="stable")
        return np.asarray(R[next((k for k in order if self._is_joined(R[k])), order[0])])

    def _is_joined(self, R: Float[Array, "S 3 3"]) -> bool:
        """Whether edges of which a hypothesis is likelier than none join all shots."""
        believed = self.edges.believed(self._shares(R))
        return len(set(_connected(len(R), self.ends[believed]))) == 1

    # ---- how good rotations are

    def _relative(self, R: Float[Array, "*n S 3 3"]) -> Float[Array, "*n E 3 3"]:
        """Rotations from each edge's shot b to its shot a."""
        a, b = self.ends.T
        return np.asarray(np.swapaxes(R[..., a, :, :], -1, -2) @ R[..., b, :, :])

    def _shares(self, R: Float[Array, "*n S 3 3"]) -> Shares:
        return self.edges.shares(self._relative(R))

    def _score(self, R: Float[Array, "n S 3 3"]) -> Float[Array, " n"]:
        """Logarithm of the posterior probability near each set of rotations: what the edges and gravity say there,
        times the volume within which they say it (else the more precise of two hypotheses would always win)."""
        at_once = max(1, AT_ONCE // len(self.edges.R))
        if len(R) > at_once:
            return np.concatenate([self._score(R[k : k + at_once]) for k in range(0, len(R), at_once)])
        shares = self._shares(R)
        gravity, kappa = self.upright.log_density(R)
        volume = self._log_volume(*self.edges.precision(shares), kappa)
        return np.asarray(gravity + self.edges.log_density(shares) + volume)

    def _log_volume(
        self, every: Float[Array, "*n E"], level: Float[Array, "*n E"], kappa: Float[Array, "*n S"]
    ) -> Float[Array, "*n"]:
        """Of what edges of these precisions and verticals of these concentrations leave open."""
        num = len(self.shots)
        unknown = UNKNOWN_PRECISION * np.eye(num) + laplacian(self.ends, every, num)
        return log_graph_volume(unknown, curvature(kappa) + laplacian(self.ends, level, num))

    # ---- search

    def _order(self) -> list[int]:
        """The shots in an order in which each is connected to one before, the surest connections first."""
        order, done = [0], {0}
        surest = np.maximum.reduceat(self.edges.log_peak, self.edges.first)
        while len(order) < len(self.shots):
            open_edges = [
                (float(peak), -max(a, b), a if b in done else b)
                for edge, peak, (a, b) in zip(self.edges.edges, surest, self.ends.tolist(), strict=True)
                if (a in done) != (b in done) and edge.connects
            ]
            _, _, node = max(open_edges)
            order.append(node)
            done.add(node)
        return order

    def _beam(self) -> Float[Array, "n S 3 3"]:
        """The best joint hypotheses, best first."""
        up, kappas = self.upright.up, np.stack([self.upright.kappa, self.upright.kappa_if_wrong])
        log_prior = np.log([1 - WRONG, WRONG])
        R = np.tile(np.eye(3), (2, len(self.shots), 1, 1))  # the first shot's vertical may be right or wrong
        score = log_prior
        kappa_mean = kappas[:, :1] * up[0]
        order = self._order()
        for count, node in enumerate(order[1:], start=1):
            others = self.ends.sum(axis=1) - node
            meeting = np.flatnonzero((self.ends == node).any(axis=1) & np.isin(others, order[:count]))
            edges, others, is_later = self.edges.some(meeting), others[meeting], self.ends[meeting, 1] == node
            R_other_node = np.where(is_later[edges.of_edge, None, None], edges.R, np.swapaxes(edges.R, -1, -2))
            candidates = R[:, others[edges.of_edge]] @ R_other_node
            gained, every, level = (np.empty(candidates.shape[:2]) for _ in range(3))
            for k in range(len(R)):
                relative = np.swapaxes(R[k, others], -1, -2) @ candidates[k][:, None]
                shares = edges.shares(np.where(is_later[:, None, None], relative, np.swapaxes(relative, -1, -2)))
                gained[k] = edges.log_density(shares)
                every[k], level[k] = (precision.sum(axis=-1) for precision in edges.precision(shares))
            kappa = kappas[:, node, None, None, None]
            mean = kappa_mean[:, None] + kappa * (candidates @ up[node])
            before = log_sinhc(np.linalg.norm(kappa_mean, axis=-1))[:, None]
            agree = log_sinhc(np.linalg.norm(mean, axis=-1)) - before - log_sinhc(kappa[..., 0])
            every = every + UNKNOWN_PRECISION
            volume = log_volume(np.log(every), np.log(every + level + kappa[..., 0]))
            total = score[:, None] + gained + log_prior[:, None, None] + agree + volume
            wrong, total = total.argmax(axis=0), total.max(axis=0)
            parent, child = _distinct(total, candidates)
            kappa_mean = mean[wrong[parent, child], parent, child]
            R, score = R[parent], total[parent, child]
            R[:, node] = candidates[parent, child]
        return R

    def _alternatives(self, R: Float[Array, "S 3 3"], k: int) -> Float[Array, "n S 3 3"]:
        """Other rotations at the cut before the group's shot k: all shots from k on rotated alike, shot k alone, or
        shot k - 1 alone, as a hypothesis of an edge has it."""
        everything = np.arange(len(R))
        a, b = self.ends[self.edges.of_edge].T
        found = [np.zeros((0, *R.shape))]
        for moving in (everything >= k, everything == k, everything == k - 1):
            if moving[0] and moving.sum() == 1:
                continue
            # By its hypothesis R_a_b, shot b is to be R[a] R_a_b: the step from where it is, or back if a moves.
            step = R[a] @ self.edges.R @ np.swapaxes(R[b], -1, -2)
            step = np.where(moving[b][:, None, None], step, np.swapaxes(step, -1, -2))
            new = (moving[a] != moving[b]) & (rotation_angle(step) >= np.radians(DISTINCT_DEG))
            moved = np.repeat(R[None], new.sum(), axis=0)
            moved[:, moving] = step[new][:, None] @ R[moving]
            found.append(moved)
        return np.concatenate(found)

    # ---- rotation averaging

    def _averaged(self, R: Float[Array, "n S 3 3"], iterations: int = ITERATIONS) -> Float[Array, "n S 3 3"]:
        """The nearest maxima of the posterior: Gauss-Newton on the hypotheses in their present shares, and on gravity.

        Verticals d of concentrations κ have the density |Σ κ d| (see `Verticals`): with their mean m its gradient is
        κ m × d about level axes, its curvature diag κ − κ κᵀ / Σ κ.
        """
        fixed = 1e-6 * np.eye(R.shape[1] - 1)
        for _ in range(iterations):
            H, g = self._normal(R)
            kappa = self.upright.log_density(R).kappa
            up, mean = self._verticals(R, kappa)
            g = g - kappa[..., None] * np.cross(up, mean)
            about_up = np.sum(g * mean, axis=-1, keepdims=True) * mean
            step = np.zeros((*R.shape[:2], 3))
            step[:, 1:] = -np.linalg.solve(H[:, 1:, 1:] + fixed, about_up[:, 1:])
            step[:, 1:] -= np.linalg.solve((H + curvature(kappa))[:, 1:, 1:] + fixed, (g - about_up)[:, 1:])
            length = np.linalg.norm(step, axis=-1, keepdims=True)
            step *= np.minimum(1.0, 0.3 / np.maximum(length, 1e-12))
            R = rotvec_to_rotmat(step) @ R
            if np.abs(step).max(initial=0.0) < CONVERGED_RAD:
                break
        # Alternatives are products of rotations that were alternatives before: rounding would grow with every one.
        return nearest_rotation(R)

    def _normal(self, R: Float[Array, "n S 3 3"]) -> tuple[Float[Array, "n S S"], Float[Array, "n S 3"]]:
        """Gauss-Newton matrix of each axis and gradient, of rotation vectors on the left of R.

        Residual of a hypothesis: log(R_a_bᵀ R_aᵀ R_b) in the axes of the group; to first order it changes by δ_b − δ_a.
        """
        edges, num = self.edges, R.shape[1]
        relative = self._relative(R)
        shares = edges.shares(relative)
        residual = rotmat_to_rotvec(np.swapaxes(edges.R, -1, -2) @ relative[:, edges.of_edge])
        squared = (residual**2).sum(axis=-1) / edges.sigma**2
        # weight of the t distribution (Lange, Little and Taylor 1989)
        weight = np.exp(shares.hypotheses - shares.density[:, edges.of_edge]) * (DEGREES_OF_FREEDOM + 3)
        weight /= (DEGREES_OF_FREEDOM + squared) * edges.sigma**2
        a, b = self.ends.T
        pull = R[:, b] @ np.add.reduceat(weight[..., None] * residual, edges.first, axis=1)[..., None]
        incidence = np.eye(num)[b] - np.eye(num)[a]
        return laplacian(self.ends, np.add.reduceat(weight, edges.first, axis=1), num), incidence.T @ pull[..., 0]

    # ---- how certain they are

    def certainty(self, R: Float[Array, "S 3 3"]) -> dict[int, Certainty]:
        """Of the rotation between every two shots of the group that follow on one another in it, by the later one."""
        H, _ = self._normal(R[None])
        covariance = np.zeros((len(R), len(R)))
        covariance[1:, 1:] = np.linalg.inv(H[0, 1:, 1:] + 1e-3 * np.eye(len(R) - 1))
        variance = np.diagonal(covariance)
        between = variance[1:] + variance[:-1] - 2 * np.diagonal(covariance, 1)
        sigma_deg = np.hypot(SPREAD * QUANTILE_68 * np.degrees(np.sqrt(between)), SHARED_DEG)
        return {self.shots[k]: self._with_alternatives(R, k, float(sigma_deg[k - 1])) for k in range(1, len(R))}

    def _with_alternatives(self, R: Float[Array, "S 3 3"], k: int, sigma_deg: float) -> Certainty:
        """The errors that 68 and 95 % stay below: of the rotation chosen, and of the others by their probabilities."""

        def at_cut(every: Float[Array, "n S 3 3"]) -> Float[Array, "n 3 3"]:
            return np.asarray(np.swapaxes(every[:, k - 1], -1, -2) @ every[:, k])

        here, elsewhere = float(self._score(R[None])[0]), np.radians(ELSEWHERE_DEG)
        (chosen,) = at_cut(R[None])
        others = self._alternatives(R, k)
        others = others[rotation_distance(chosen, at_cut(others)) > elsewhere]
        others = self._averaged(others[np.argsort(-self._score(others))[:REFINED]], REFINING)
        apart = [chosen]
        weights = [1.0]
        for mode, score in zip(at_cut(others), self._score(others), strict=True):
            if (rotation_distance(np.stack(apart), mode) > elsewhere).all():
                apart.append(mode)
                weights.append(float(np.exp(EVIDENCE_COUNTS * min(score - here, 0.0))))
        # Beyond all hypotheses: every edge across the cut is wrong.
        nowhere = float(np.exp(EVIDENCE_COUNTS * (self._score_without(R, k) - here)))
        share = (1 - LEFT_OPEN) / (sum(weights) + nowhere)
        grid = np.linspace(0.1, 180.0, 1800)
        inside = (nowhere * share + LEFT_OPEN) * (np.radians(grid) - np.sin(np.radians(grid))) / np.pi
        for angle, weight in zip(np.degrees(rotation_distance(chosen, np.stack(apart))), weights, strict=True):
            inside += weight * share * _normal_inside(grid - angle, sigma_deg, bool(angle))
        most, nearly_all = (float(grid[inside >= quantile].min(initial=180.0)) for quantile in (0.68, 0.95))
        return Certainty(most, nearly_all, share)

    def _score_without(self, R: Float[Array, "S 3 3"], k: int) -> float:
        """The same score if none of the hypotheses of any edge across the cut were true."""
        across = (self.ends < k).sum(axis=1) == 1
        shares = self._shares(R)
        density = np.where(across, self.edges.log_none, shares.density)  # of those across: anywhere
        score = float(density @ self.edges.weight)
        every, level = (
            laplacian(self.ends, np.where(across, 0.0, precision), len(R)) for precision in self.edges.precision(shares)
        )
        # Either side by itself: how they are rotated against each other nobody knows.
        for side in (slice(None, k), slice(k, None)):
            gravity, kappa = Verticals(self.upright.up[side], self.upright.kappa[side]).log_density(R[None, side])
            unknown = UNKNOWN_PRECISION * np.eye(len(R[side])) + every[side, side]
            score += float(gravity[0] + log_graph_volume(unknown, curvature(kappa[0]) + level[side, side]))
        return score

    def sorted_out(self, R: Float[Array, "S 3 3"]) -> Iterator[tuple[RotationEdge, RotationHypothesis | float]]:
        """Each edge with its hypothesis that is likelier than none, or with how far its nearest one is off, degrees."""
        edges, relative = self.edges, self._relative(R)
        shares = edges.shares(relative)
        off = np.degrees(rotation_distance(edges.R, relative[edges.of_edge]))
        starts = zip(edges.first, [*edges.first[1:], len(off)], strict=True)
        for edge, believed, (first, end) in zip(edges.edges, edges.believed(shares), starts, strict=True):
            if believed:
                yield edge, edge.hypotheses[int(shares.hypotheses[first:end].argmax())]
            else:
                yield edge, float(off[first:end].min())


def _normal_inside(angle: Float[Array, " n"], sigma_deg: float, distant: bool) -> Float[Array, " n"]:
    """Fraction of normal rotation errors below an angle; for a distant mode, of one axis about its distance."""
    z = angle / (max(sigma_deg, 0.1) / QUANTILE_68)
    if distant:
        return np.asarray(0.5 * (1 + np.tanh(0.8 * z)))
    return np.asarray(erf(z / math.sqrt(2)) - math.sqrt(2 / math.pi) * z * np.exp(-(z**2) / 2))


def _distinct(score: Float[Array, "n c"], R: Float[Array, "n c 3 3"]) -> tuple[list[int], list[int]]:
    """The best BEAM pairs of parent and candidate; of one parent's candidates that are nearly equal the best."""
    parents: list[int] = []
    children: list[int] = []
    left = score.copy()
    while len(parents) < BEAM and np.isfinite(left.max()):
        n, c = divmod(int(left.argmax()), left.shape[1])
        parents.append(n)
        children.append(c)
        left[n, rotation_distance(R[n, c], R[n]) < np.radians(DISTINCT_DEG)] = -np.inf
    return parents, children
