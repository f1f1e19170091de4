"""Rotations in numpy, batched over leading axes: exponential map, logarithm, angle, interpolation, skew, Kabsch.

Rotation vectors are axis times angle, radians. Everything is float64.
"""

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

Array = np.ndarray


def skew(v: Float[Array, "*batch 3"]) -> Float[Array, "*batch 3 3"]:
    """The matrix [v]× with [v]× w = v × w."""
    out = np.zeros((*v.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return out


def rotation_from_vector(vector: ArrayLike) -> Float[Array, "*batch 3 3"]:
    """Exponential map (Rodrigues): rotation vectors (…,3) to matrices (…,3,3)."""
    w = np.asarray(vector, np.float64)
    squared = np.sum(w * w, axis=-1)[..., None, None]
    angle = np.sqrt(squared)
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    sine = np.where(small, 1 - squared / 6, np.sin(safe) / safe)  # sin θ / θ
    cosine = np.where(small, 0.5 - squared / 24, (1 - np.cos(safe)) / (safe * safe))  # (1 − cos θ) / θ²
    K = skew(w)
    return np.asarray(np.eye(3) + sine * K + cosine * (w[..., :, None] * w[..., None, :] - squared * np.eye(3)))


def vector_from_rotation(R: Float[Array, "*batch 3 3"]) -> Float[Array, "*batch 3"]:
    """Logarithm: rotation matrices to rotation vectors of angle 0..π, through the unit quaternion: stable up to π."""
    q = quaternion_from_rotation(R)
    q = np.where(q[..., :1] < 0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, q[..., :1])
    scale = np.where(sine < 1e-9, 2.0, angle / np.where(sine < 1e-9, 1.0, sine))
    return np.asarray(q[..., 1:] * scale)


def quaternion_from_rotation(R: Float[Array, "*batch 3 3"]) -> Float[Array, "*batch 4"]:
    """Unit quaternions (w, x, y, z) of rotation matrices; the sign is arbitrary."""
    R = np.asarray(R, np.float64)
    m = [[R[..., i, j] for j in range(3)] for i in range(3)]
    trace = m[0][0] + m[1][1] + m[2][2]
    # Four equivalent formulas; each is good where its own component is large.
    candidates = np.stack(
        [
            np.stack([1 + trace, m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]], -1),
            np.stack([m[2][1] - m[1][2], 1 + 2 * m[0][0] - trace, m[0][1] + m[1][0], m[0][2] + m[2][0]], -1),
            np.stack([m[0][2] - m[2][0], m[0][1] + m[1][0], 1 + 2 * m[1][1] - trace, m[1][2] + m[2][1]], -1),
            np.stack([m[1][0] - m[0][1], m[0][2] + m[2][0], m[1][2] + m[2][1], 1 + 2 * m[2][2] - trace], -1),
        ],
        axis=-2,
    )
    best = np.argmax(np.stack([candidates[..., k, k] for k in range(4)], -1), axis=-1)
    q = np.take_along_axis(candidates, best[..., None, None], axis=-2)[..., 0, :]
    return np.asarray(q / np.linalg.norm(q, axis=-1, keepdims=True))


def nearest_rotation(M: Float[Array, "*batch 3 3"]) -> Float[Array, "*batch 3 3"]:
    """The rotation R that maximises trace(Rᵀ M): projection onto SO(3) by singular values."""
    U, _, Vt = np.linalg.svd(M)
    U[..., :, 2] *= np.sign(np.linalg.det(U @ Vt))[..., None]
    return np.asarray(U @ Vt)


def kabsch(
    source: Float[Array, "*batch points 3"],
    target: Float[Array, "*batch points 3"],
    weight: Float[Array, "*batch points"],
) -> Float[Array, "*batch 3 3"]:
    """R_target_source that best turns `source` onto `target` about their weighted means."""
    w = weight[..., None] / np.maximum(weight.sum(-1), 1e-12)[..., None, None]
    source = source - np.sum(w * source, axis=-2, keepdims=True)
    target = target - np.sum(w * target, axis=-2, keepdims=True)
    return nearest_rotation(np.einsum("...pi,...pj->...ij", w * target, source))


def swing(source: Float[Array, "*batch 3"], target: Float[Array, "*batch 3"]) -> Float[Array, "*batch 3 3"]:
    """The smallest rotation that takes the direction of `source` to that of `target` (half a turn has no axis: any)."""
    a = source / np.maximum(np.linalg.norm(source, axis=-1, keepdims=True), 1e-12)
    b = target / np.maximum(np.linalg.norm(target, axis=-1, keepdims=True), 1e-12)
    axis = np.cross(a, b)
    cosine = np.sum(a * b, axis=-1)
    sine = np.linalg.norm(axis, axis=-1)
    helper = np.where(np.abs(a[..., :1]) < 0.9, np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    fallback = np.cross(a, helper)
    axis = np.where(sine[..., None] > 1e-9, axis, fallback)
    axis = axis / np.maximum(np.linalg.norm(axis, axis=-1, keepdims=True), 1e-12)
    return rotation_from_vector(axis * np.arctan2(sine, cosine)[..., None])


def rotation_angle(R: Float[Array, "*batch 3 3"]) -> Float[Array, "*batch"]:
    """Rotation angle in radians, accurate near zero."""
    sine = 0.5 * np.linalg.norm(
        np.stack([R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], -1), axis=-1
    )
    return np.asarray(np.arctan2(sine, 0.5 * (np.trace(R, axis1=-2, axis2=-1) - 1.0)))


def interpolate_rotations(
    at: Float[Array, " n"], known_at: Float[Array, " k"], R: Float[Array, "k 3 3"]
) -> Float[Array, "n 3 3"]:
    """Spherical interpolation between the two known rotations around each place; ends are held.

    `known_at` increases.
    """
    if len(known_at) == 1:
        return np.repeat(R, len(at), axis=0)
    after = np.clip(np.searchsorted(known_at, at, side="right"), 1, len(known_at) - 1)
    before = after - 1
    share = np.clip((at - known_at[before]) / (known_at[after] - known_at[before]), 0.0, 1.0)
    step = vector_from_rotation(np.swapaxes(R[before], -1, -2) @ R[after])
    return np.asarray(R[before] @ rotation_from_vector(share[:, None] * step))
