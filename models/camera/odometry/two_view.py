"""Pose of a second view from points seen in both, and the pair of keyframes to start from."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from humanmm.models.camera.odometry.colmap import pycolmap
from humanmm.models.camera.odometry.tracked_shot import TrackedShot
from humanmm.models.geometry import rotations
from humanmm.models.geometry.robust import cauchy_weight, std_of_lengths

NUM_PLACES = 5
MIN_SHARED = 30
"""Points that two keyframes must share to start the odometry."""
ENOUGH_PARALLAX_FRACTION = 0.01
"""Parallax (image motion left after the best rotation), as a fraction of the diagonal, with which a two-view pose is
safe."""


@dataclass(frozen=True)
class Pair:
    """Two keyframes (positions in the list of keyframes) and the median parallax between them."""

    first: int
    second: int
    parallax_px: float


def rays(xy: Float[np.ndarray, "n 2"], focal_px: float) -> Float[np.ndarray, "n 3"]:
    """Unit directions of centred pixels in camera axes."""
    direction = np.concatenate([xy / focal_px, np.ones((len(xy), 1))], 1)
    return np.asarray(direction / np.linalg.norm(direction, axis=1, keepdims=True))


def wahba_rotation(
    direction: Float[np.ndarray, "n 3"], ray: Float[np.ndarray, "n 3"], R_start: Float[np.ndarray, "3 3"]
) -> Float[np.ndarray, "3 3"]:
    """R with direction ≈ R ray, by reweighted Kabsch; outliers fade out from the second round on."""
    if len(ray) < 2:
        return R_start
    weight = np.ones(len(ray))
    R = R_start
    for _ in range(5):
        R = rotations.nearest_rotation((direction * weight[:, None]).T @ ray)
        error = np.linalg.norm(direction - ray @ R.T, axis=1)
        scale = max(std_of_lengths(error), 1e-4)
        weight = cauchy_weight((error / (2 * scale)) ** 2)
    return R


def parallax_px(xy_a: Float[np.ndarray, "n 2"], xy_b: Float[np.ndarray, "n 2"], focal_px: float) -> float:
    """Median angle, in pixels, that is left between two views after the best rotation."""
    ray_a, ray_b = rays(xy_a, focal_px), rays(xy_b, focal_px)
    R_a_b = wahba_rotation(ray_a, ray_b, np.eye(3))
    return focal_px * float(np.median(np.linalg.norm(ray_a - ray_b @ R_a_b.T, axis=1)))


def starting_pairs(shot: TrackedShot, keyframes: Int[np.ndarray, " k"], focal_px: float) -> list[Pair]:
    """Pairs of keyframes to start from, at several instants of the shot, those with most parallax and points first.

    At each instant the second keyframe is the nearest one with safe parallax, or the one with most.
    """
    enough = ENOUGH_PARALLAX_FRACTION * shot.diagonal_px
    found: list[tuple[float, Pair]] = []
    for first in np.unique(np.linspace(0, len(keyframes) - 2, NUM_PLACES).astype(int)):
        best: tuple[float, Pair] | None = None
        for second in range(int(first) + 1, len(keyframes)):
            _, xy_a, xy_b = shot.shared(int(keyframes[first]), int(keyframes[second]))
            if len(xy_a) < MIN_SHARED:
                break
            parallax = parallax_px(xy_a, xy_b, focal_px)
            strength = min(parallax, enough) * float(np.sqrt(len(xy_a)))
            if best is None or strength > best[0]:
                best = strength, Pair(int(first), second, parallax)
            if parallax > enough:
                break
        if best is not None:
            found.append(best)
    return [pair for _, pair in sorted(found, key=lambda one: -one[0])]


def five_point_pose(
    xy_a: Float[np.ndarray, "n 2"], xy_b: Float[np.ndarray, "n 2"], focal_px: float, *, max_error_px: float
) -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, " 3"]] | None:
    """R_a_b and the unit position of b in a's axes, by pycolmap's five-point RANSAC; None if it finds none."""
    pycolmap.set_random_seed(0)
    camera = pycolmap.Camera(model="SIMPLE_PINHOLE", width=2, height=2, params=[focal_px, 0.0, 0.0])
    options = pycolmap.RANSACOptions(random_seed=0, max_error=max_error_px, min_num_trials=100, max_num_trials=2000)
    found = pycolmap.estimate_essential_matrix(xy_a, xy_b, camera, camera, options)
    if found is None:
        return None
    b_from_a = found["cam2_from_cam1"]
    R_b_a = np.asarray(b_from_a.rotation.matrix())
    t = np.asarray(b_from_a.translation)
    length = float(np.linalg.norm(t))
    if length < 1e-9:
        return None
    return R_b_a.T, -R_b_a.T @ t / length
