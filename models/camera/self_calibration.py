"""The focal length of one camera track from its own points (self-calibration): a rotating camera shows it by how the
picture bends at its edges, a moving one by which focal length lets all points be rigid.

The Gauss-Newton matrix says how well the points determine it. Points that do not determine it give a large standard
deviation: nothing is guessed here.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool

from humanmm.models.camera.odometry.bundle import Adjusted, Freedom, Observations, Points, Views, adjust, focal_step
from humanmm.models.camera.odometry.keyframe_odometry import Track
from humanmm.models.geometry import rotations

MAX_STEP = 0.4
"""Largest change of ln(focal) taken at once."""
MAX_STEPS = 8
CONVERGED = 0.003


@dataclass(frozen=True)
class FocalTrack:
    """A camera track with its own focal length."""

    track: Track
    log_focal_sigma: float
    """Standard deviation of ln(focal), correlation of the errors along a point's track allowed for; infinite of a track
    that keeps the focal length that was assumed."""


def with_own_focal(track: Track, freedom: Freedom) -> FocalTrack:
    """The track with the focal length that fits its points best: Newton steps on the focal, all else adjusted after
    each."""
    solution, observations, fixed = track.adjusted, track.observations, track.held
    sigma = float("inf")
    reach = MAX_STEP
    for _ in range(MAX_STEPS):
        step, sigma = focal_step(solution, observations, fixed=fixed, freedom=freedom)
        step = float(np.clip(step, -reach, reach))
        tried = _adjusted_at(solution, observations, step, fixed, freedom)
        if tried.noise_px > 1.02 * solution.noise_px and abs(step) > CONVERGED:
            reach = abs(step) / 3
            continue
        solution = tried
        if abs(step) < CONVERGED:
            break
    refined = replace(track, views=solution.views, points=solution.points, adjusted=solution)
    return FocalTrack(refined, sigma * correlation(observations))


def correlation(observations: Observations) -> float:
    """Factor on the standard deviation: a tracker's error stays with the point, so a track is one observation."""
    lengths = np.bincount(observations.point)
    lengths = lengths[lengths > 0]
    return float(np.sqrt(lengths.mean())) if len(lengths) else 1.0


def _adjusted_at(
    solution: Adjusted, observations: Observations, log_step: float, fixed: Bool[np.ndarray, " k"], freedom: Freedom
) -> Adjusted:
    views, points = with_focal(solution.views, solution.points, observations, float(np.exp(log_step)))
    return adjust(views, points, observations, fixed=fixed, freedom=freedom, iterations=6)


def with_focal(views: Views, points: Points, observations: Observations, factor: float) -> tuple[Views, Points]:
    """Views and points carried over to a focal length `factor` times as long, so that they project nearly as before.

    Rotations across the optical axis and steps across it shrink by the factor; directions are read anew off each
    point's first sighting.
    """
    across = np.array([1 / factor, 1 / factor, 1.0])
    R_old, t_old = views.R_shot_cam, views.t_shot_cam
    R_new, t_new = R_old.copy(), t_old.copy()
    rotvecs = rotations.rotmat_to_rotvec(np.swapaxes(R_old[:-1], 1, 2) @ R_old[1:])
    steps = np.einsum("kji,kj->ki", R_old[:-1], np.diff(t_old, axis=0))
    for k in range(1, len(R_old)):
        R_new[k] = R_new[k - 1] @ rotations.rotvec_to_rotmat((rotvecs[k - 1] * across)[None])[0]
        t_new[k] = t_new[k - 1] + R_new[k - 1] @ (steps[k - 1] * across)
    moved = replace(views, R_shot_cam=R_new, t_shot_cam=t_new, focal_px=views.focal_px * factor)

    point, first = np.unique(observations.point, return_index=True)
    image = observations.image[first]
    distance = np.linalg.norm(
        points.direction[point] + points.rho[point, None] * (points.anchor[point] - t_old[image]), axis=1
    )
    ray = np.concatenate([observations.xy[first] / moved.focals_px[image, None], np.ones((len(point), 1))], 1)
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    direction, rho, anchor = points.direction.copy(), points.rho.copy(), points.anchor.copy()
    direction[point] = np.einsum("pij,pj->pi", R_new[image], ray)
    anchor[point] = t_new[image]
    rho[point] = points.rho[point] / distance
    return moved, Points(direction, rho, anchor)
