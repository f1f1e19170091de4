"""How people hold and move their joints: a small statistic of motion capture, shipped as weights/pose_prior.npz
(`body.pose_statistics`).

A mixture of Gaussians over the rotation vectors of the 19 free body joints (standing, walking, crouching, … are
different habits: one Gaussian for all of them would bend a standing man's knees), the range of each component, and the
usual size of accelerations. `estimate` makes it from motion-capture packs (scripts/build_pose_prior); the model card
beside the file says from which.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from humanmm.models.body.body24 import FREE_JOINTS
from humanmm.models.body.pose_statistics import PoseStatistics
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.motion.fit.state import BODY, NUM_PARAMETERS, PELVIS, ROOT

Array = np.ndarray

_MIRROR_JOINT = (0, 2, 1, 3, 5, 4, 6, 8, 7, 9, 11, 10, 12, 14, 13, 15, 17, 16, 19, 18, 21, 20, 23, 22)

LEAST_STD = 0.06
"""Radians: captured collars and spines are stiffer than people's; no component is believed narrower than this."""

NUM_HABITS = 12
"""Gaussians of the mixture; 6 to 24 say about the same on people they were not made from."""

WIDE_FRACTION, WIDE_SCALE = 0.02, 1.5
"""One more Gaussian, of all poses together with its covariance scaled, for what the others never saw."""

_EVERY = 8
"""Neighbouring frames are nearly equal: every eighth is enough for the mixture."""

RANGE_QUANTILE, RANGE_MARGIN = 0.002, 0.15
"""The joint limits lie this far (radians) outside the quantiles of each component."""


def mirrored(poses: Float[Array, "frames 24 3"]) -> Float[Array, "frames 24 3"]:
    """Local rotation vectors of the mirror-image body (x → −x)."""
    return np.asarray(poses[:, list(_MIRROR_JOINT)] * np.array([1.0, -1.0, -1.0]))


def estimate(
    clips: Sequence[tuple[Float[Array, "frames 24 3"], Float[Array, "frames 3"]]], fps: float
) -> PoseStatistics:
    """Statistics of clips (local rotation vectors, root first; pelvis positions) and of their mirror images."""
    free = list(FREE_JOINTS)
    vectors, sparse, accelerations = [], [], []
    for poses, pelvis in clips:
        for each in (poses, mirrored(poses)):
            R = rotvec_to_rotmat(each)
            vectors.append(rotmat_to_rotvec(R[:, free]).reshape(len(each), -1))
            sparse.append(vectors[-1][::_EVERY])
            angular_velocity = rotmat_to_rotvec(np.swapaxes(R[:-1], -1, -2) @ R[1:]) * fps
            angular = np.diff(angular_velocity, axis=0) * fps
            row = np.empty((len(angular), NUM_PARAMETERS))
            row[:, ROOT], row[:, BODY] = angular[:, 0], angular[:, free].reshape(len(row), -1)
            row[:, PELVIS] = np.linalg.norm(np.diff(pelvis, 2, axis=0), axis=1, keepdims=True) * fps * fps / np.sqrt(3)
            accelerations.append(row)
    x, a = np.concatenate(vectors), np.concatenate(accelerations)
    lower, upper = np.quantile(x, RANGE_QUANTILE, axis=0), np.quantile(x, 1 - RANGE_QUANTILE, axis=0)
    # Flips of captured joints must not widen a Gaussian.
    shares, means, covariances = _mixture(np.clip(np.concatenate(sparse), lower, upper), NUM_HABITS)
    inside = np.clip(x, lower, upper)
    cap = np.quantile(np.abs(a), 0.995, axis=0)
    return PoseStatistics(
        shares=np.append(shares * (1 - WIDE_FRACTION), WIDE_FRACTION),
        means=np.concatenate([means, inside.mean(axis=0)[None]]),
        covariances=np.concatenate([covariances, WIDE_SCALE * _floored(np.cov(inside, rowvar=False))[None]]),
        lower=lower - RANGE_MARGIN,
        upper=upper + RANGE_MARGIN,
        acceleration=np.sqrt(np.mean(np.clip(a, -cap, cap) ** 2, axis=0)),
    )


def _floored(covariance: Float[Array, "57 57"]) -> Float[Array, "57 57"]:
    """No component narrower than LEAST_STD, and none quite tied to the others."""
    missing = np.maximum(LEAST_STD**2 - np.diag(covariance), 0) + 0.25 * LEAST_STD**2
    return np.asarray(covariance + np.diag(missing))


def _mixture(x: Float[Array, "n 57"], count: int) -> tuple[Array, Array, Array]:
    """Weights, means and covariances by expectation-maximisation from a k-means++ start, seed 0."""
    rng = np.random.default_rng(0)
    centres = x[rng.integers(len(x))][None]
    for _ in range(count - 1):
        nearest = np.min([np.sum((x - centre) ** 2, axis=1) for centre in centres], axis=0)
        centres = np.append(centres, x[rng.choice(len(x), p=nearest / nearest.sum())][None], axis=0)
    for _ in range(15):
        label = np.argmin(np.sum(centres**2, axis=1) - 2 * x @ centres.T, axis=1)
        centres = np.stack([x[label == k].mean(axis=0) if (label == k).any() else centres[k] for k in range(count)])
    belongs = np.eye(count)[label]
    for _ in range(40):
        mass = belongs.sum(axis=0) + 1e-9
        means = belongs.T @ x / mass[:, None]
        log_density = np.empty((len(x), count))
        covariances = np.empty((count, x.shape[1], x.shape[1]))
        for k in range(count):
            gap = x - means[k]
            covariances[k] = _floored((belongs[:, k, None] * gap).T @ gap / mass[k])
            root = np.linalg.cholesky(covariances[k])
            squared = np.sum(np.linalg.solve(root, gap.T) ** 2, axis=0)
            log_density[:, k] = np.log(mass[k]) - np.log(np.diag(root)).sum() - 0.5 * squared
        belongs = np.exp(log_density - log_density.max(axis=1, keepdims=True))
        belongs /= belongs.sum(axis=1, keepdims=True)
    return mass / mass.sum(), means, covariances
