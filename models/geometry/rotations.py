"""Rotations in numpy, batched over leading axes: exponential map, logarithm, angle, interpolation, skew.

Rotation vectors are axis times angle, radians; quaternions are (w, x, y, z). Everything is float64. Names as in roma.
"""

import math

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

Array = np.ndarray


def unit(v: Float[Array, "*batch 3"]) -> Float[Array, "*batch 3"]:
    """The vectors at length 1; a vector of length 0 stays 0."""
    return np.asarray(v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-12))


def skew(v: Float[Array, "*batch 3"]) -> Float[Array, "*batch 3 3"]:
    """The matrix [v]× with [v]× w = v × w."""
    out = np.zeros((*v.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return out


def rotvec_to_rotmat(vector: ArrayLike) -> Float[Array, "*batch 3 3"]:
    """Exponential map: rotation vectors (…,3) to matrices (…,3,3).

    Rodrigues' formula, R = I + sin θ / θ [w]× + (1 − cos θ) / θ² [w]×², with Taylor's series below 1e-4 radians.
    """
    w = np.asarray(vector, np.float64)
    squared = np.sum(w * w, axis=-1)[..., None, None]
    angle = np.sqrt(squared)
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    sine = np.where(small, 1 - squared / 6, np.sin(safe) / safe)  # sin θ / θ
    cosine = np.where(small, 0.5 - squared / 24, (1 - np.cos(safe)) / (safe * safe))  # (1 − cos θ) / θ²
    K = skew(w)
    return np.asarray(np.eye(3) + sine * K + cosine * (w[..., :, None] * w[..., None, :] - squared * np.eye(3)))


def rotmat_to_rotvec(R: Float[Array, "*batch 3 3"]) -> Float[Array, "*batch 3"]:
    """Logarithm: rotation matrices to rotation vectors of angle 0..π, radians.

    θ = atan2(sin θ, cos θ) about the axis of R − Rᵀ, whose length is 2 sin θ; above NEAR_PI, where that vanishes,
    through the unit quaternion: θ = 2 atan2(|q_xyz|, q_w).
    """
    R = np.asarray(R, np.float64)
    vector = np.empty(R.shape[:-1])
    for k, (i, j) in enumerate(((2, 1), (0, 2), (1, 0))):
        vector[..., k] = 0.5 * (R[..., i, j] - R[..., j, i])
    sine = np.sqrt((vector * vector).sum(axis=-1))
    cosine = 0.5 * (R[..., 0, 0] + R[..., 1, 1] + R[..., 2, 2] - 1.0)
    vector *= (np.arctan2(sine, cosine) / np.where(sine < 1e-12, 1.0, sine) + (sine < 1e-12))[..., None]
    far = cosine < math.cos(NEAR_PI)
    if far.any():
        q = rotmat_to_unitquat_wxyz(R[far])
        q = np.where(q[..., :1] < 0, -q, q)
        sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
        vector[far] = q[..., 1:] * (2 * np.arctan2(sine, q[..., :1]) / sine)
    return vector


NEAR_PI = 3.0
"""Rotation angle above which the axis is not read off R − Rᵀ, radians."""


def rotmat_to_unitquat_wxyz(R: Float[Array, "*batch 3 3"]) -> Float[Array, "*batch 4"]:
    """Unit quaternions (w, x, y, z) of rotation matrices; the sign is arbitrary.

    Shepperd 1978, "Quaternion from rotation matrix".
    """
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
    """The rotation R that maximises trace(Rᵀ M): projection onto SO(3) by singular values.

    The special orthogonal Procrustes problem (Umeyama 1991, lemma); Σ w target sourceᵀ as M solves Wahba's problem of
    directions (Markley 1988, "Attitude determination using vector observations and the singular value decomposition").
    """
    U, _, Vt = np.linalg.svd(M)
    U[..., :, 2] *= np.sign(np.linalg.det(U @ Vt))[..., None]
    return np.asarray(U @ Vt)


def swing(source: Float[Array, "*batch 3"], target: Float[Array, "*batch 3"]) -> Float[Array, "*batch 3 3"]:
    """The smallest rotation that takes the direction of `source` to that of `target`.

    Axis a × b, angle atan2(|a × b|, a · b): the swing of a swing-twist decomposition. Opposite directions leave the
    axis open: any is returned.
    """
    a, b = unit(source), unit(target)
    axis = np.cross(a, b)
    cosine = np.sum(a * b, axis=-1)
    sine = np.linalg.norm(axis, axis=-1)
    helper = np.where(np.abs(a[..., :1]) < 0.9, np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    fallback = np.cross(a, helper)
    axis = np.where(sine[..., None] > 1e-9, axis, fallback)
    return rotvec_to_rotmat(unit(axis) * np.arctan2(sine, cosine)[..., None])


def rotation_angle(R: Float[Array, "*batch 3 3"]) -> Float[Array, "*batch"]:
    """Geodesic distance from the identity, radians, 0..π: atan2(sin θ, cos θ).

    The arc cosine of the trace alone is inexact near zero.
    """
    sine = 0.5 * np.linalg.norm(
        np.stack([R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], -1), axis=-1
    )
    return np.asarray(np.arctan2(sine, 0.5 * (np.trace(R, axis1=-2, axis2=-1) - 1.0)))


def rotation_distance(R_a: Float[Array, "*batch 3 3"], R_b: Float[Array, "*batch 3 3"]) -> Float[Array, "*batch"]:
    """Angle between rotations, radians, 0..π: 2 asin(‖R_a − R_b‖ / √8), from ‖R_a − R_b‖² = 8 sin²(θ / 2).

    As good as `rotation_angle` of R_aᵀ R_b, without the product; within 1e-7 of π the sine is flat.
    """
    difference = R_a - R_b
    squared = np.einsum("...ij,...ij->...", difference, difference)
    return np.asarray(2 * np.arcsin(np.minimum(np.sqrt(squared / 8), 1.0)))


def angle_between_deg(R_a: Float[Array, "3 3"], R_b: Float[Array, "3 3"]) -> float:
    """Angle between two rotations, degrees."""
    return float(np.rad2deg(rotation_angle(R_a.T @ R_b)))


def interpolate_rotations(
    at: Float[Array, " n"], known_at: Float[Array, " k"], R: Float[Array, "k 3 3"]
) -> Float[Array, "n 3 3"]:
    """Rotations at times `at`, interpolated between the two known ones around each; the ends are held.

    Spherical linear interpolation (Shoemake 1985), R_a exp(f log(R_aᵀ R_b)). `known_at` increases.
    """
    if len(known_at) == 1:
        return np.repeat(R, len(at), axis=0)
    after = np.clip(np.searchsorted(known_at, at, side="right"), 1, len(known_at) - 1)
    before = after - 1
    fraction = np.clip((at - known_at[before]) / (known_at[after] - known_at[before]), 0.0, 1.0)
    step = rotmat_to_rotvec(np.swapaxes(R[before], -1, -2) @ R[after])
    return np.asarray(R[before] @ rotvec_to_rotmat(fraction[:, None] * step))
