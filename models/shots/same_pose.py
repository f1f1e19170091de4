"""Whether two bodies seen right before and right after a cut hold one pose: log-odds that they are one person's.

The camera's rotation is not known yet, so poses are compared up to any rotation. People mostly stand alike: two poses
that are equally near each other say the more the farther both are from how people hold themselves on average.
"""

from functools import lru_cache

import numpy as np
from jaxtyping import Float

from humanmm.models.body.body24 import FREE_JOINTS, NUM_JOINTS, load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.body.landmarks import load_landmarks
from humanmm.models.body.pose_statistics import load_pose_statistics
from humanmm.models.geometry.alignment import umeyama_alignment
from humanmm.models.records import landmarks

Array = np.ndarray

CONSTANT, SLOPE = -1.2, 4.4
"""Of a logistic regression on the logarithm of how unusual both poses are over how far they are apart, on development
clips (docs/measurements/identity.md); `scripts/fit_identity` fits it to others."""
NOISE_M = 0.08
"""Of landmarks: poses that are nearer to the average than this are as usual as they can be told to be."""
LEAST, MOST = -1.0, 1.5
"""Films leave out time at cuts, then people go on in other poses; and strangers hold themselves alike. Measured is -2.5
to 2.5; with that twice as many strangers become one person, and no link more is found (docs/measurements/identity.md).
"""


def same_pose_odds(before: Float[Array, "33 3"], after: Float[Array, "33 3"]) -> float:
    """Log-odds for one person, of the 3D landmarks (metres) on both sides of a cut."""
    return float(np.clip(CONSTANT + SLOPE * log_ratio(before, after), LEAST, MOST))


def log_ratio(before: Float[Array, "33 3"], after: Float[Array, "33 3"]) -> float:
    """Logarithm of how far two poses are from the average one over how far they are apart."""
    unusual = [np.hypot(residual_m(average_pose(), pose), NOISE_M) for pose in (before, after)]
    return float(np.log(np.sqrt(np.mean(np.square(unusual))) / max(residual_m(before, after), 1e-6)))


def residual_m(a: Float[Array, "33 3"], b: Float[Array, "33 3"]) -> float:
    """Root mean square distance of the limbs after the best rotation, left and right swapped or not."""
    limbs = list(landmarks.LIMBS)
    return min(_after_rotation(a[limbs], b[limbs]), _after_rotation(a[limbs], b[landmarks.SWAP][limbs]))


def _after_rotation(a: Float[Array, "n 3"], b: Float[Array, "n 3"]) -> float:
    aligned = umeyama_alignment(a, b, with_scale=False, unique=False).apply(a)
    return float(np.sqrt(np.square(aligned - b).sum() / len(a)))


@lru_cache(maxsize=1)
def average_pose() -> Float[Array, "33 3"]:
    """Landmarks of the mean of all poses of the pose prior, metres."""
    body = load_body()
    betas = np.zeros(body.num_betas)
    pose = np.zeros((1, NUM_JOINTS, 3))
    pose[0, list(FREE_JOINTS)] = load_pose_statistics().mean.reshape(-1, 3)
    joints, R = forward_kinematics(body.rest_joints(betas), np.eye(3)[None], pose[:, 1:], np.zeros((1, 3)))
    return np.asarray(load_landmarks().place(betas, joints, R)[0])
