"""How people hold and move their joints: a small statistic of motion capture, shipped as weights/pose_prior.npz.

A Gaussian over the rotation vectors of the 19 free body joints, the range of each component, and the usual size of
accelerations. `estimate` makes it from motion-capture packs (scripts/build_pose_prior); the model card beside the
file says from which.
"""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float

from humanmm.models.body.rotations import rotation_from_vector, vector_from_rotation
from humanmm.models.motion.fit_state import BODY, FREE_JOINTS, NUM_PARAMETERS, PELVIS, ROOT
from humanmm.models.weights.shipped import read_weights

Array = np.ndarray

_MIRROR_JOINT = (0, 2, 1, 3, 5, 4, 6, 8, 7, 9, 11, 10, 12, 14, 13, 15, 17, 16, 19, 18, 21, 20, 23, 22)

LEAST_STD = 0.06
"""Radians: captured collars and spines are stiffer than people's; no component is believed narrower than this."""

RANGE_QUANTILE, RANGE_MARGIN = 0.002, 0.15
"""The soft walls stand this far (radians) outside the quantiles of each component."""


@dataclass(frozen=True, eq=False)
class PoseStatistics:
    """Rotation vectors of FREE_JOINTS (57 numbers, radians), and accelerations of a fit's 63 parameters."""

    mean: Float[Array, " 57"]
    covariance: Float[Array, "57 57"]
    lower: Float[Array, " 57"]
    upper: Float[Array, " 57"]
    acceleration: Float[Array, " 63"]
    """Root mean square: rad/s², m/s² for the pelvis."""


def mirrored(poses: Float[Array, "frames 24 3"]) -> Float[Array, "frames 24 3"]:
    """Local rotation vectors of the mirror-image body (x → −x)."""
    return np.asarray(poses[:, list(_MIRROR_JOINT)] * np.array([1.0, -1.0, -1.0]))


def estimate(
    clips: Sequence[tuple[Float[Array, "frames 24 3"], Float[Array, "frames 3"]]], fps: float
) -> PoseStatistics:
    """Statistics of clips (local rotation vectors, root first; pelvis positions) and of their mirror images."""
    free = list(FREE_JOINTS)
    vectors, accelerations = [], []
    for poses, pelvis in clips:
        for each in (poses, mirrored(poses)):
            R = rotation_from_vector(each)
            vectors.append(vector_from_rotation(R[:, free]).reshape(len(each), -1))
            turn = vector_from_rotation(np.swapaxes(R[:-1], -1, -2) @ R[1:]) * fps
            angular = np.diff(turn, axis=0) * fps
            row = np.empty((len(angular), NUM_PARAMETERS))
            row[:, ROOT], row[:, BODY] = angular[:, 0], angular[:, free].reshape(len(row), -1)
            row[:, PELVIS] = np.linalg.norm(np.diff(pelvis, 2, axis=0), axis=1, keepdims=True) * fps * fps / np.sqrt(3)
            accelerations.append(row)
    x, a = np.concatenate(vectors), np.concatenate(accelerations)
    lower, upper = np.quantile(x, RANGE_QUANTILE, axis=0), np.quantile(x, 1 - RANGE_QUANTILE, axis=0)
    inside = np.clip(x, lower, upper)  # flips of captured joints must not widen the Gaussian
    covariance = np.cov(inside, rowvar=False)
    covariance += np.diag(np.maximum(LEAST_STD**2 - np.diag(covariance), 0) + 0.25 * LEAST_STD**2)
    cap = np.quantile(np.abs(a), 0.995, axis=0)
    return PoseStatistics(
        mean=inside.mean(axis=0),
        covariance=covariance,
        lower=lower - RANGE_MARGIN,
        upper=upper + RANGE_MARGIN,
        acceleration=np.sqrt(np.mean(np.clip(a, -cap, cap) ** 2, axis=0)),
    )


@lru_cache(maxsize=1)
def load_pose_statistics() -> PoseStatistics:
    """The shipped statistics, checked against their sha256."""
    with np.load(io.BytesIO(read_weights("pose_prior.npz"))) as file:
        return PoseStatistics(**{name: file[name].astype(np.float64) for name in PoseStatistics.__dataclass_fields__})
