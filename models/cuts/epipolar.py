"""Relative camera pose from matched body keypoints of two pictures: the paper's Camera Calibration (section 3.3.1,
appendix).

The essential matrix E obeys x_beforeᵀ E x_after = 0 for rays x = K⁻¹ (u, v, 1). Three things are mended against the
paper's text, and change nothing of its idea: Hartley's normalisation before the eight-point step, K⁻¹ (not K⁻ᵀ) for
the rays, and the cheirality test over all four decompositions instead of the first one.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

Array = np.ndarray

MIN_MATCHES = 8


@dataclass(frozen=True)
class TwoView:
    """Relative pose of two cameras from matched points."""

    R_before_after: Float[Array, "3 3"]
    t_before_after: Float[Array, "3"]
    """Direction of the second camera's centre in the first one's axes (unit length: the scale is unknown)."""
    inliers: Bool[Array, "n"]
    residual: float
    """Median Sampson distance of the inliers, in units of x/z."""


def essential_eight_point(x_before: Float[Array, "n 2"], x_after: Float[Array, "n 2"]) -> Float[Array, "3 3"]:
    """E with x_beforeᵀ E x_after = 0 from at least eight matched rays (x/z, y/z), singular values made (1, 1, 0)."""
    first, T_before = _normalised(x_before)
    second, T_after = _normalised(x_after)
    A = np.einsum("na,nb->nab", first, second).reshape(-1, 9)
    _, _, Vt = np.linalg.svd(A)
    E = T_before.T @ Vt[-1].reshape(3, 3) @ T_after
    U, _, Vt = np.linalg.svd(E)
    return np.asarray(U @ np.diag([1.0, 1.0, 0.0]) @ Vt)


def sampson(E: Float[Array, "3 3"], x_before: Float[Array, "n 2"], x_after: Float[Array, "n 2"]) -> Float[Array, "n"]:
    """First-order distance of each match to the epipolar constraint, in units of x/z."""
    a, b = _homogeneous(x_before), _homogeneous(x_after)
    line_before, line_after = b @ E.T, a @ E
    slope = (line_before[:, :2] ** 2).sum(axis=1) + (line_after[:, :2] ** 2).sum(axis=1)
    return np.asarray(np.abs(np.einsum("na,na->n", a, line_before)) / np.sqrt(np.maximum(slope, 1e-12)))


def decompose(E: Float[Array, "3 3"]) -> list[tuple[Float[Array, "3 3"], Float[Array, "3"]]]:
    """The four (R_before_after, t_before_after) that an essential matrix allows."""
    U, _, Vt = np.linalg.svd(E)
    U, Vt = U * np.sign(np.linalg.det(U)), Vt * np.sign(np.linalg.det(Vt))
    W = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    return [(U @ M @ Vt, sign * U[:, 2]) for M in (W, W.T) for sign in (1.0, -1.0)]


def in_front_of_both(
    R: Float[Array, "3 3"], t: Float[Array, "3"], x_before: Float[Array, "n 2"], x_after: Float[Array, "n 2"]
) -> Bool[Array, "n"]:
    """Matches whose triangulated point lies before both cameras (cheirality)."""
    a, b = _homogeneous(x_before), _homogeneous(x_after) @ R.T
    # depth_a a − depth_b b = t, solved for both depths in the least-squares sense.
    aa, bb, ab = (a * a).sum(1), (b * b).sum(1), (a * b).sum(1)
    at, bt = a @ t, b @ t
    determinant = np.maximum(aa * bb - ab**2, 1e-12)
    depth_a = (bb * at - ab * bt) / determinant
    depth_b = (ab * at - aa * bt) / determinant
    return np.asarray((depth_a > 0) & (depth_b > 0))


def eight_point_pose(
    x_before: Float[Array, "n 2"],
    x_after: Float[Array, "n 2"],
    *,
    threshold: float,
    iterations: int = 200,
    seed: int = 0,
) -> TwoView | None:
    """RANSAC over eight matches at a time, then all inliers together; None with fewer than eight matches.

    `threshold` is the largest Sampson distance of an inlier, in units of x/z.
    """
    n = len(x_before)
    if n < MIN_MATCHES:
        return None
    rng = np.random.default_rng(seed)
    best: Array = np.zeros(n, dtype=bool)
    best_score = -np.inf
    for _ in range(iterations if n > MIN_MATCHES else 1):
        sample = rng.choice(n, MIN_MATCHES, replace=False)
        distance = sampson(essential_eight_point(x_before[sample], x_after[sample]), x_before, x_after)
        # Truncated squares: among samples with the same number of inliers the closer one wins.
        score = -float(np.square(np.minimum(distance, threshold)).sum())
        if score > best_score:
            best, best_score = distance < threshold, score
    chosen = best if best.sum() >= MIN_MATCHES else np.ones(n, dtype=bool)
    E = essential_eight_point(x_before[chosen], x_after[chosen])
    R, t = max(
        decompose(E), key=lambda pose: int(in_front_of_both(pose[0], pose[1], x_before[chosen], x_after[chosen]).sum())
    )
    return TwoView(R, t, chosen, float(np.median(sampson(E, x_before[chosen], x_after[chosen]))))


def _homogeneous(x: Float[Array, "n 2"]) -> Float[Array, "n 3"]:
    return np.concatenate([x, np.ones((len(x), 1))], axis=1)


def _normalised(x: Float[Array, "n 2"]) -> tuple[Float[Array, "n 3"], Float[Array, "3 3"]]:
    """Hartley: centroid at the origin, mean distance √2; the points and the transform."""
    centre = x.mean(axis=0)
    scale = np.sqrt(2) / max(float(np.linalg.norm(x - centre, axis=1).mean()), 1e-12)
    T = np.array([[scale, 0, -scale * centre[0]], [0, scale, -scale * centre[1]], [0, 0, 1.0]])
    return _homogeneous(x) @ T.T, T
