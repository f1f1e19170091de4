"""Least-squares alignment of corresponding points: similarity or rigid motion, rotation alone, rotation about z."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from humanmm.models.geometry.rotations import nearest_rotation


class DegenerateAlignmentError(ValueError):
    """Many alignments of these points are equally good; the message says which further points would decide."""


@dataclass(frozen=True)
class Similarity:
    """target ≈ scale · R_target_source @ source + translation, for one or a batch of point sets."""

    scale: Float[np.ndarray, "*batch"]
    R_target_source: Float[np.ndarray, "*batch 3 3"]
    translation: Float[np.ndarray, "*batch 3"]

    def apply(self, points: Float[np.ndarray, "*batch points 3"]) -> Float[np.ndarray, "*batch points 3"]:
        """The points in the target's axes, position and size."""
        rotated = points @ np.swapaxes(self.R_target_source, -1, -2)
        return np.asarray(self.scale[..., None, None] * rotated + self.translation[..., None, :])


def umeyama_alignment(
    source: Float[np.ndarray, "*batch points 3"],
    target: Float[np.ndarray, "*batch points 3"],
    *,
    with_scale: bool = True,
    unique: bool = True,
) -> Similarity:
    """The similarity (or, without scale, the rigid motion) that takes source to target with least squared error.

    Umeyama 1991, "Least-squares estimation of transformation parameters between two point patterns", eq. 34-42.
    Points on one line, or all in one position, leave the rotation open: DegenerateAlignmentError. With `unique=False`
    any of the equally good answers is returned, for callers who use only the distances that remain.
    """
    source_mean = source.mean(axis=-2, keepdims=True)  # eq. 34
    target_mean = target.mean(axis=-2, keepdims=True)  # eq. 35
    source_centred = source - source_mean
    target_centred = target - target_mean
    covariance = np.swapaxes(target_centred, -1, -2) @ source_centred  # eq. 38, times the number of points
    U, singular_values, Vt = np.linalg.svd(covariance)
    if unique and (singular_values[..., 1] <= np.finfo(float).eps * singular_values[..., 0]).any():
        raise DegenerateAlignmentError(
            "The points of one side lie on one line or in one position, so their rotation is not determined: "
            "give at least three points that span a plane."
        )
    signs = np.ones(covariance.shape[:-1])  # the diagonal of S
    signs[..., 2] = np.where(np.linalg.det(U @ Vt) < 0, -1.0, 1.0)  # eq. 39 and 43
    R = (U * signs[..., None, :]) @ Vt  # eq. 40
    scale = np.ones(covariance.shape[:-2])
    if with_scale:
        variance = (source_centred**2).sum(axis=(-1, -2))  # eq. 36, times the number of points
        scale = (singular_values * signs).sum(axis=-1) / np.maximum(variance, np.finfo(float).tiny)  # eq. 42
    rotated_mean = (R @ np.swapaxes(source_mean, -1, -2))[..., 0]
    return Similarity(scale, R, target_mean[..., 0, :] - scale[..., None] * rotated_mean)  # eq. 41


def kabsch(
    source: Float[np.ndarray, "*batch points 3"],
    target: Float[np.ndarray, "*batch points 3"],
    weight: Float[np.ndarray, "*batch points"],
) -> Float[np.ndarray, "*batch 3 3"]:
    """R_target_source that best takes `source` to `target` about their weighted means.

    Kabsch 1976, "A solution for the best rotation to relate two sets of vectors"; proper rotation after Kabsch 1978.
    """
    w = weight[..., None] / np.maximum(weight.sum(-1), 1e-12)[..., None, None]
    source = source - np.sum(w * source, axis=-2, keepdims=True)
    target = target - np.sum(w * target, axis=-2, keepdims=True)
    return nearest_rotation(np.einsum("...pi,...pj->...ij", w * target, source))


def yaw_alignment(
    source: Float[np.ndarray, "*points 3"], target: Float[np.ndarray, "*points 3"]
) -> Float[np.ndarray, "3 3"]:
    """(3,3) the rotation about the world's z axis that takes source to target with least squared error.

    It maximises Σ targetᵀ R_z(ψ) source: tan ψ = Σ (x_s y_t − y_s x_t) / Σ (x_s x_t + y_s y_t); the four-degree
    alignment of Zhang and Scaramuzza 2018, "A tutorial on quantitative trajectory evaluation", without its translation.
    """
    sine = (source[..., 0] * target[..., 1] - source[..., 1] * target[..., 0]).sum()
    cosine = (source[..., 0] * target[..., 0] + source[..., 1] * target[..., 1]).sum()
    return yaw_to_rotmat(float(np.arctan2(sine, cosine)))


def yaw_to_rotmat(yaw: float) -> Float[np.ndarray, "3 3"]:
    """(3,3) rotation by `yaw` radians about z."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
