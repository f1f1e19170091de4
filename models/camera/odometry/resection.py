"""Poses of images against known points: Gauss-Newton on many images at once, each on its own (no image sees
another)."""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.camera.odometry.bundle import (
    MIN_DEPTH,
    Freedom,
    Observations,
    Points,
    Views,
    image_jacobian,
    noise_of,
    project,
)
from humanmm.models.geometry import rotations
from humanmm.models.geometry.robust import cauchy_weight


def resect(
    views: Views, points: Points, observations: Observations, *, freedom: Freedom, iterations: int = 5
) -> tuple[Views, Float[np.ndarray, " m"], Bool[np.ndarray, " k"]]:
    """Views refined against fixed points, the residuals, and which images had enough sightings to be refined.

    `observations.image` must be sorted. Starts from the given poses: they must be near (the last frame's pose will do).
    """
    width = 3 + 3 * freedom.translation + freedom.zoom
    image = observations.image
    num_images = len(views.log_zoom)
    if not len(image):
        return views, np.zeros(0), np.zeros(num_images, bool)
    counts = np.bincount(image, minlength=num_images)
    enough = counts >= 2 * width
    used = np.flatnonzero(counts)
    starts = np.searchsorted(image, used)
    residual = np.full(len(image), np.inf)
    for iteration in range(iterations + 1):
        q, xy = project(views, points, observations)
        front = q[:, 2] > MIN_DEPTH
        error = np.where(front[:, None], observations.xy - xy, 0.0)
        residual = np.where(front, np.linalg.norm(error, axis=1), np.inf)
        if iteration == iterations:
            break
        noise = _noise_per_image(residual, used, starts, num_images)[image]
        weight = np.where(front, cauchy_weight((np.minimum(residual, 1e4) / (2 * noise)) ** 2), 0.0)
        J, _ = image_jacobian(views, points.rho, observations, q, front, freedom)
        H = np.zeros((num_images, width, width))
        g = np.zeros((num_images, width))
        weighted = J * weight[:, None, None]
        H[used] = np.add.reduceat(np.einsum("mri,mrj->mij", weighted, J), starts, axis=0)
        g[used] = np.add.reduceat(np.einsum("mri,mr->mi", weighted, error), starts, axis=0)
        scale = 1.0 / np.sqrt(np.maximum(np.einsum("kii->ki", H), 1e-12))
        H = H * scale[:, :, None] * scale[:, None, :] + 1e-6 * np.eye(width)
        delta = scale * np.linalg.solve(H, (scale * g)[:, :, None])[:, :, 0]
        delta[~enough] = 0.0
        views = _moved(views, delta, freedom)
        if np.abs(delta[:, :3]).max(initial=0.0) < 1e-6:
            iterations = iteration + 1
    return views, residual, enough


def _noise_per_image(residual: np.ndarray, used: np.ndarray, starts: np.ndarray, num_images: int) -> np.ndarray:
    noise = np.ones(num_images)
    ends = [*starts[1:], len(residual)]
    for index, begin, end in zip(used, starts, ends, strict=True):
        noise[index] = noise_of(residual[begin:end], 0.2)
    return noise


def _moved(views: Views, delta: np.ndarray, freedom: Freedom) -> Views:
    moved = replace(views, R_shot_cam=views.R_shot_cam @ rotations.rotvec_to_rotmat(delta[:, :3]))
    if freedom.translation:
        moved = replace(moved, t_shot_cam=views.t_shot_cam + delta[:, 3:6])
    if freedom.zoom:
        moved = replace(moved, log_zoom=views.log_zoom + delta[:, -1])
    return moved
