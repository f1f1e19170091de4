"""Points in space from what several calibrated cameras see of them, some of them wrong.

Hartley and Zisserman 2004, section 12.2 (the linear method), over all cameras that agree with a pair of them (RANSAC
over every pair: a rig has few cameras). Pictures are ideal ones: undistorted, at unit focal length (x / z, y / z).
"""

from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.geometry.projection import project, world_to_camera

Array = np.ndarray
LEAST = 2
NEAR_M = 1e-3


def triangulated(
    xy: Float[Array, "C *points 2"],
    weight: Float[Array, "C *points"],
    R_world_cam: Float[Array, "C 3 3"],
    t_world_cam: Float[Array, "C 3"],
    limit: Float[Array, "C *#points"],
    *,
    least: int = LEAST,
) -> tuple[Float[Array, "*points 3"], Float[Array, "C *points"]]:
    """Points in the world, and how far from each camera's picture of them they lie (inf: behind it, NaN: not seen).

    `weight`: how much a camera's picture counts, 0 where it has none; `limit`: how far it may lie from its point. A
    point that fewer than `least` cameras agree on is NaN.
    """
    if len(xy) < LEAST:
        raise ValueError(f"{len(xy)} camera: a point needs {LEAST}")
    shape = xy.shape[1:-1]
    xy = xy.reshape(len(xy), -1, 2)
    weight = np.where(np.isfinite(xy).all(axis=-1), weight.reshape(len(xy), -1), 0.0)
    limit = np.broadcast_to(limit, (len(xy), *shape)).reshape(len(xy), -1)
    equations = _equations(np.nan_to_num(xy), R_world_cam, t_world_cam)
    best = np.zeros((xy.shape[1], 3))
    votes = np.zeros(xy.shape[1])
    for pair in combinations(range(len(xy)), 2):
        of_pair = np.zeros_like(weight)
        of_pair[list(pair)] = (weight[list(pair)] > 0).all(axis=0)
        points = _solved(equations, of_pair)
        error = _errors(points, xy, weight, R_world_cam, t_world_cam)
        # among equally many cameras the pair counts that the others lie nearest to
        agreed = np.where(error < limit, 2 - error / limit, 0.0).sum(axis=0) * of_pair[pair[0]]
        better = agreed > votes
        best[better], votes[better] = points[better], agreed[better]
    agrees = _errors(best, xy, weight, R_world_cam, t_world_cam) < limit
    points = _solved(equations, weight * agrees)
    points[(agrees.sum(axis=0) < least) | (votes == 0)] = np.nan
    error = _errors(points, xy, weight, R_world_cam, t_world_cam)
    return points.reshape(*shape, 3), error.reshape(len(xy), *shape)


def _equations(
    xy: Float[Array, "C N 2"], R_world_cam: Float[Array, "C 3 3"], t_world_cam: Float[Array, "C 3"]
) -> Float[Array, "C N 2 4"]:
    """Rows x P₃ − P₁ and y P₃ − P₂, whose product with the homogeneous point is zero."""
    R_cam_world = np.swapaxes(R_world_cam, -1, -2)
    P = np.concatenate([R_cam_world, -R_cam_world @ t_world_cam[..., None]], axis=-1)
    return np.asarray(xy[..., None] * P[:, None, 2:] - P[:, None, :2])


def _solved(equations: Float[Array, "C N 2 4"], weight: Float[Array, "C N"]) -> Float[Array, "N 3"]:
    """The points that solve the weighted equations best."""
    rows = equations * weight[..., None, None]
    _, vectors = np.linalg.eigh(np.einsum("cnij,cnik->njk", rows, rows))
    homogeneous = vectors[..., 0]
    w = homogeneous[:, 3:]
    return np.asarray(homogeneous[:, :3] / np.where(np.abs(w) < 1e-12, 1e-12, w))


def _errors(
    points: Float[Array, "N 3"],
    xy: Float[Array, "C N 2"],
    weight: Float[Array, "C N"],
    R_world_cam: Float[Array, "C 3 3"],
    t_world_cam: Float[Array, "C 3"],
) -> Float[Array, "C N"]:
    """How far each camera's picture lies from the point's: NaN where it has none, inf where the point is behind it."""
    in_camera = world_to_camera(np.broadcast_to(points, (len(xy), *points.shape)), R_world_cam, t_world_cam)
    error = np.linalg.norm(project(in_camera, np.eye(3), near_m=NEAR_M) - xy, axis=-1)
    seen: Bool[Array, "C N"] = weight > 0
    return np.asarray(np.where(seen, np.where(in_camera[..., 2] > NEAR_M, error, np.inf), np.nan))
