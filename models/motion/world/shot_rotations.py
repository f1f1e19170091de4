"""One rotation per shot from all evidence: people at the cuts (`cuts`) and backgrounds (`camera.background`).

Every piece of evidence is an edge of a graph whose nodes are shots. A background edge with few inliers can be chance;
it is believed if the people say the same within what both may err, or if it has so many inliers that chance is out of
the question. The rotations then minimise the robust, weighted disagreement with all believed edges (rotation averaging,
Hartley et al., IJCV 2013, by iteratively reweighted Gauss-Newton steps).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from humanmm.models.geometry.robust import cauchy_weight
from humanmm.models.geometry.rotations import rotation_angle, rotmat_to_rotvec, rotvec_to_rotmat

CERTAIN_INLIERS = 60
"""Background edges with so many inliers are believed against the people (who may be left-right swapped)."""
GATE_SIGMAS = 3.0
MIN_GATE_DEG, MAX_GATE_DEG = 15.0, 45.0
"""Largest angle between people and background for an uncertain edge; 45° is passed by chance once in 60."""
ITERATIONS = 20


@dataclass(frozen=True)
class RotationEdge:
    """Shot b's axes to shot a's, with its standard deviation in degrees; `num_inliers` is 0 for edges from people."""

    a: int
    b: int
    R_a_b: Float[np.ndarray, "3 3"]
    sigma_deg: float
    num_inliers: int = 0
    same_camera: bool = False


@dataclass(frozen=True)
class ShotRotations:
    """Rotations of all shots, shot b's axes to those of the first shot of its group."""

    R_group_shot: Float[np.ndarray, "shots 3 3"]
    group: tuple[int, ...]
    """First shot of the connected group that a shot belongs to."""
    believed: tuple[RotationEdge, ...]
    rejected: tuple[RotationEdge, ...]


def average_rotations(
    num_shots: int, people: Sequence[RotationEdge], background: Sequence[RotationEdge]
) -> ShotRotations:
    """Rotations of all shots from people edges (all believed) and background edges (checked against the others)."""
    believed, rejected = list(people), []
    for edge in sorted(background, key=lambda e: -e.num_inliers):
        if _is_credible(edge, num_shots, believed):
            believed.append(edge)
        else:
            rejected.append(edge)
    R, group = _spread(num_shots, believed)
    for _ in range(ITERATIONS):
        step = _step(R, believed, group)
        R = R @ rotvec_to_rotmat(step)
        if np.abs(step).max() < 1e-9:
            break
    return ShotRotations(R, group, tuple(believed), tuple(rejected))


def _is_credible(edge: RotationEdge, num_shots: int, believed: Sequence[RotationEdge]) -> bool:
    if edge.num_inliers >= CERTAIN_INLIERS or edge.same_camera:
        return True
    R, group, variance = _spread_with_variance(num_shots, believed)
    if group[edge.a] != group[edge.b]:
        return False  # nobody vouches for it
    gate = GATE_SIGMAS * np.sqrt(edge.sigma_deg**2 + abs(variance[edge.a] - variance[edge.b]))
    apart_deg = float(np.degrees(rotation_angle(R[edge.a].T @ R[edge.b] @ edge.R_a_b.T)))
    return apart_deg < float(np.clip(gate, MIN_GATE_DEG, MAX_GATE_DEG))


def _spread(num_shots: int, edges: Sequence[RotationEdge]) -> tuple[Float[np.ndarray, "shots 3 3"], tuple[int, ...]]:
    R, group, _ = _spread_with_variance(num_shots, edges)
    return R, group


def _spread_with_variance(
    num_shots: int, edges: Sequence[RotationEdge]
) -> tuple[Float[np.ndarray, "shots 3 3"], tuple[int, ...], Float[np.ndarray, " shots"]]:
    """Start: from each group's first shot along the most certain paths (Dijkstra on variances)."""
    R = np.tile(np.eye(3), (num_shots, 1, 1))
    group, variance = [-1] * num_shots, np.full(num_shots, np.inf)
    for first in range(num_shots):
        if group[first] >= 0:
            continue
        variance[first] = 0.0
        group[first] = first
        done: set[int] = set()
        while open_shots := [s for s in range(num_shots) if group[s] == first and s not in done]:
            here = min(open_shots, key=lambda s: variance[s])
            done.add(here)
            for edge in edges:
                if here not in (edge.a, edge.b):
                    continue
                there = edge.b if here == edge.a else edge.a
                new = variance[here] + edge.sigma_deg**2
                if new < variance[there] and there not in done:
                    variance[there], group[there] = new, first
                    R[there] = R[here] @ (edge.R_a_b if here == edge.a else edge.R_a_b.T)
    return R, tuple(group), variance


def _step(
    R: Float[np.ndarray, "shots 3 3"], edges: Sequence[RotationEdge], group: Sequence[int]
) -> Float[np.ndarray, "shots 3"]:
    """One reweighted Gauss-Newton step, as rotation vectors on the right of R; a group's first shot is held.

    Residual of an edge: log(R_a_bᵀ R_aᵀ R_b); to first order it changes by δ_b − (R_bᵀ R_a) δ_a.
    """
    num_shots = len(R)
    H, g = np.zeros((num_shots, 3, num_shots, 3)), np.zeros((num_shots, 3))
    for edge in edges:
        residual = rotmat_to_rotvec(edge.R_a_b.T @ R[edge.a].T @ R[edge.b])
        sigma = np.radians(edge.sigma_deg)
        weight = cauchy_weight(residual @ residual / (2 * sigma) ** 2) / sigma**2
        blocks = {edge.a: -R[edge.b].T @ R[edge.a], edge.b: np.eye(3)}
        for i, J_i in blocks.items():
            g[i] += weight * J_i.T @ residual
            for j, J_j in blocks.items():
                H[i, :, j] += weight * J_i.T @ J_j
    free = [s for s in range(num_shots) if group[s] != s]
    step = np.zeros((num_shots, 3))
    if free:
        n = 3 * len(free)
        H_free = H[free][:, :, free].reshape(n, n) + 1e-9 * np.eye(n)
        step[free] = -np.linalg.solve(H_free, g[free].ravel()).reshape(-1, 3)
    return step
