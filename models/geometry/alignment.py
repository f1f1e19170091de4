"""Least-squares alignment of corresponding points: similarity (Umeyama 1991), rigid, and yaw about the vertical."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class Similarity:
    """target ≈ scale · R_target_source @ source + translation, for one or a batch of point sets."""

    scale: Float[np.ndarray, "*batch"]
    R_target_source: Float[np.ndarray, "*batch 3 3"]
    translation: Float[np.ndarray, "*batch 3"]

    def apply(self, points: Float[np.ndarray, "*batch points 3"]) -> Float[np.ndarray, "*batch points 3"]:
        """The points in the target's axes, place and size."""
        rotated = points @ np.swapaxes(self.R_target_source, -1, -2)
        return np.asarray(self.scale[..., None, None] * rotated + self.translation[..., None, :])


def fit_similarity(
    source: Float[np.ndarray, "*batch points 3"],
    target: Float[np.ndarray, "*batch points 3"],
    *,
    with_scale: bool = True,
) -> Similarity:
    """The similarity (or, without scale, the rigid motion) that carries source onto target with least squared error.

    Points that all lie in one place leave the scale at 0 / the rotation arbitrary, as least squares does.
    """
    source_mean = source.mean(axis=-2, keepdims=True)
    target_mean = target.mean(axis=-2, keepdims=True)
    source_centred = source - source_mean
    target_centred = target - target_mean
    covariance = np.swapaxes(target_centred, -1, -2) @ source_centred
    U, singular_values, Vt = np.linalg.svd(covariance)
    signs = np.ones(covariance.shape[:-1])
    signs[..., 2] = np.where(np.linalg.det(U @ Vt) < 0, -1.0, 1.0)
    R = (U * signs[..., None, :]) @ Vt
    scale = np.ones(covariance.shape[:-2])
    if with_scale:
        variance = (source_centred**2).sum(axis=(-1, -2))
        scale = (singular_values * signs).sum(axis=-1) / np.maximum(variance, np.finfo(float).tiny)
    translation = target_mean[..., 0, :] - scale[..., None] * (R @ np.swapaxes(source_mean, -1, -2))[..., 0]
    return Similarity(scale, R, translation)


def fit_yaw(source: Float[np.ndarray, "*points 3"], target: Float[np.ndarray, "*points 3"]) -> Float[np.ndarray, "3 3"]:
    """(3,3) the rotation about the world's z axis that carries source onto target with least squared error."""
    sine = (source[..., 0] * target[..., 1] - source[..., 1] * target[..., 0]).sum()
    cosine = (source[..., 0] * target[..., 0] + source[..., 1] * target[..., 1]).sum()
    return yaw_rotation(float(np.arctan2(sine, cosine)))


def yaw_rotation(yaw: float) -> Float[np.ndarray, "3 3"]:
    """(3,3) rotation by `yaw` radians about z."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def rotation_angle_deg(R: Float[np.ndarray, "*batch 3 3"]) -> Float[np.ndarray, "*batch"]:
    """Geodesic angle of rotations, degrees; exact near 0, where the arc cosine of the trace is not."""
    chord = np.linalg.norm(R - np.eye(3), axis=(-1, -2)) / np.sqrt(8.0)
    return np.asarray(np.degrees(2.0 * np.arcsin(np.clip(chord, 0.0, 1.0))))
