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
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from humanmm.models.geometry.rotations import rotation_angle, rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.motion.world.rotation_mixtures import (
    DEGREES_OF_FREEDOM,
    QUANTILE_68,
    UNKNOWN_PRECISION,
    Mixture,
    RotationEdge,
    RotationHypothesis,
    Upright,
    Volume,
    log_volume,
    mixtures,
)

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
    """Of each shot's rotation against the shot of its group before it; None for a group's first."""


def solve_rotations(
    num_shots: int, edges: Sequence[RotationEdge], upright: Sequence[Upright | None] = ()
) -> ShotRotations:
    """Rotations of all shots from all edges together; `upright`: one a shot, or none at all."""
    ups = [*upright, *[None] * (num_shots - len(upright))]
    usable = [edge for edge in edges if edge.hypotheses]
    R, group = np.tile(np.eye(3), (num_shots, 1, 1)), list(range(num_shots))
    certainty: list[Certainty | None] = [None] * num_shots
    compiled: list[Mixture] = []
    for shots in _groups(num_shots, usable):
        own = mixtures([edge for edge in usable if edge.a in shots and edge.b in shots], ups)
        compiled += own
        world = _Group(shots, own, [ups[shot] for shot in shots])
        found = world.solve()
        for shot, rotation in zip(shots, found, strict=True):
            R[shot], group[shot] = found[0].T @ rotation, shots[0]
        for shot, one in world.certainty(found).items():
            certainty[shot] = one
    between = [Refused(edge, float("nan")) for edge in usable if group[edge.a] != group[edge.b]]
    believed, refused = _sorted_out(R, compiled)
    return ShotRotations(R, tuple(group), believed, (*refused, *between), tuple(certainty))


def _groups(num_shots: int, edges: Sequence[RotationEdge]) -> list[list[int]]:
    """Shots that edges connect, each group in order."""
    labels = _connected(num_shots, [(edge.a, edge.b) for edge in edges if edge.connects])
    groups: dict[int, list[int]] = {}
    for shot, label in enumerate(labels):
        groups.setdefault(label, []).append(shot)
    return list(groups.values())


def _connected(num_shots: int, pairs: Sequence[tuple[int, int]]) -> list[int]:
    """A number for each shot, the same for all that pairs of them join."""
    a, b = np.array(pairs, int).reshape(-1, 2).T
    graph = csr_array((np.ones(len(a)), (a, b)), shape=(num_shots, num_shots))
    return [int(label) for label in connected_components(graph, directed=False)[1]]


class _Group:
    """The connected shots of one world."""

    def __init__(self, shots: Sequence[int], edges: Sequence[Mixture], upright: Sequence[Upright | None]) -> None:
        self.shots = list(shots)
        index = {shot: k for k, shot in enumerate(shots)}
        self.edges = [(edge, index[edge.a], index[edge.b]) for edge in edges]
        self.kappa = np.array([1 / math.radians(up.sigma_deg) ** 2 if up is not None else 0.0 for up in upright])
        self.up = np.stack([up.direction if up is not None else np.zeros(3) for up in upright])

    def solve(self) -> Float[Array, "shots 3 3"]:
        """The rotations of largest posterior probability, the first shot's the identity."""
        states = self._beam()
        refined = [self._averaged(R, REFINING) for R in states[:4]]
        best = self._averaged(self._best(np.stack(refined)))
        for _ in range(MOVES):
            moved = [best, *(R for k in range(1, len(self.shots)) for _, R in self._alternatives(best, k))]
            better = self._best(np.stack(moved))
            if np.array_equal(better, best):
                break
            best = self._averaged(better)
        return best

    def _best(self, R: Float[Array, "n shots 3 3"]) -> Float[Array, "shots 3 3"]:
        """The likeliest of these in which evidence that is believed joins all shots; without any, the likeliest.

        Where it is likelier that nothing is true than that any one thing is, that nothing is true is no answer.
        """
        scores = self._score(R)
        order = np.argsort(-scores, kind="stable")
        return np.asarray(R[next((k for k in order if self._is_joined(R[k])), order[0])])

    def _is_joined(self, R: Float[Array, "shots 3 3"]) -> bool:
        """Whether edges of which a hypothesis is likelier than none join all shots."""
        believed = [(a, b) for edge, a, b in self.edges if edge.likeliest(R[a].T @ R[b]) is not None]
        return len(set(_connected(len(R), believed))) == 1

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

    def _volume(self, n: int) -> Volume:
        """Before any edge: what gravity says, and nothing else."""
        unknown = np.tile(UNKNOWN_PRECISION * np.eye(len(self.shots)), (n, 1, 1))
        return Volume(unknown, np.tile(np.diag(self.kappa), (n, 1, 1)))

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
                if (a in done) != (b in done) and edge.edge.connects
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
            total = score[:, None] + gained + log_volume(np.log(every), np.log(every + level))
            parent, child = _distinct(total, candidates)
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

    def _averaged(self, R: Float[Array, "shots 3 3"], iterations: int = ITERATIONS) -> Float[Array, "shots 3 3"]:
        """The nearest maximum of the posterior: Gauss-Newton on the hypotheses in their present shares."""
        for _ in range(iterations):
            H, g = self._normal(R)
            step = np.zeros((len(R), 3))
            if len(R) > 1:
                step[1:] = -np.linalg.solve(H[3:, 3:] + 1e-6 * np.eye(3 * len(R) - 3), g[3:]).reshape(-1, 3)
            length = np.linalg.norm(step, axis=1, keepdims=True)
            step *= np.minimum(1.0, 0.3 / np.maximum(length, 1e-12))
            R = R @ rotvec_to_rotmat(step)
            if np.abs(step).max() < CONVERGED_RAD:
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
            share = np.exp(shares - np.logaddexp.reduce(shares))[:-1]
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
        """Of the rotation between every two shots of the group that follow on one another in it, by the later one."""
        if len(R) < 2:
            return {}
        H, _ = self._normal(R)
        covariance = np.zeros((3 * len(R), 3 * len(R)))
        covariance[3:, 3:] = np.linalg.inv(H[3:, 3:] + 1e-3 * np.eye(3 * len(R) - 3))
        here = float(self._score(R[None])[0])
        found = {}
        for k in range(1, len(R)):
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
                moved = self._averaged(others[which][1], REFINING)
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
    R: Float[Array, "shots 3 3"], edges: Sequence[Mixture]
) -> tuple[tuple[Believed, ...], tuple[Refused, ...]]:
    """The edges of which a hypothesis is likelier than none, with that hypothesis, and the others."""
    believed: list[Believed] = []
    refused: list[Refused] = []
    for edge in edges:
        relative = R[edge.a].T @ R[edge.b]
        likeliest = edge.likeliest(relative)
        if likeliest is not None:
            believed.append(Believed(edge.edge, edge.edge.hypotheses[likeliest]))
        else:
            off = rotation_angle(np.swapaxes(edge.R, -1, -2) @ relative)
            refused.append(Refused(edge.edge, float(np.degrees(off.min()))))
    return tuple(believed), tuple(refused)
