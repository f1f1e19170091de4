"""Rotations as 3×3 matrices, for whole arrays of them: exponential map, angle, nearest rotation, interpolation."""

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation


def skew(v: Float[np.ndarray, "*batch 3"]) -> Float[np.ndarray, "*batch 3 3"]:
    """[v]× with [v]× w = v × w."""
    matrix = np.zeros((*v.shape, 3))
    matrix[..., 0, 1], matrix[..., 0, 2] = -v[..., 2], v[..., 1]
    matrix[..., 1, 0], matrix[..., 1, 2] = v[..., 2], -v[..., 0]
    matrix[..., 2, 0], matrix[..., 2, 1] = -v[..., 1], v[..., 0]
    return matrix


def exp(rotvec: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3 3"]:
    """Rotation matrices of axis-angle vectors, radians."""
    return np.asarray(Rotation.from_rotvec(rotvec).as_matrix())


def angle(R: Float[np.ndarray, "*batch 3 3"]) -> Float[np.ndarray, "*batch"]:
    """Rotation angle in radians, accurate near zero."""
    sine = 0.5 * np.linalg.norm(
        np.stack([R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], -1), axis=-1
    )
    return np.asarray(np.arctan2(sine, 0.5 * (np.trace(R, axis1=-2, axis2=-1) - 1.0)))


def nearest(M: Float[np.ndarray, "*batch 3 3"]) -> Float[np.ndarray, "*batch 3 3"]:
    """The rotation closest to each matrix (Frobenius norm)."""
    U, _, Vt = np.linalg.svd(M)
    U = U * np.stack([np.ones(M.shape[:-2]), np.ones(M.shape[:-2]), np.linalg.det(U @ Vt)], -1)[..., None, :]
    return np.asarray(U @ Vt)


def interpolate(
    at: Float[np.ndarray, " n"], known_at: Float[np.ndarray, " k"], R: Float[np.ndarray, "k 3 3"]
) -> Float[np.ndarray, "n 3 3"]:
    """Spherical interpolation between the two known rotations around each place; ends are held. `known_at`
    increases."""
    if len(known_at) == 1:
        return np.repeat(R, len(at), axis=0)
    after = np.clip(np.searchsorted(known_at, at, side="right"), 1, len(known_at) - 1)
    before = after - 1
    share = np.clip((at - known_at[before]) / (known_at[after] - known_at[before]), 0.0, 1.0)
    step = Rotation.from_matrix(np.swapaxes(R[before], -1, -2) @ R[after]).as_rotvec()
    return np.asarray(R[before] @ exp(share[:, None] * step))


def log(R: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "n 3"]:
    """Axis-angle vectors of rotation matrices, radians."""
    return np.asarray(Rotation.from_matrix(R).as_rotvec())
