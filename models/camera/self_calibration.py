"""Focal length of one shot from its own background points: a turning camera shows it by how the picture bends at its
edges, a moving one by which focal length lets all points be rigid.

Each shot is explained as in `estimate`, but with the focal length following; the Gauss-Newton matrix says how well
the points determine it. A shot that does not determine it says so by a large sigma: nothing is guessed here.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool

from humanmm.models.camera.odometry.bundle import Adjusted, Freedom, Observations, Points, Views, adjust, focal_step
from humanmm.models.camera.odometry.keyframe_odometry import (
    EXACT_SHARE,
    MIN_POINTS,
    MOVING_GAIN,
    Track,
    also_zooming,
    moving,
    rotating,
    zooms_in,
)
from humanmm.models.camera.odometry.tracked_shot import TrackedShot, choose_keyframes
from humanmm.models.camera.static import judge_standing
from humanmm.models.geometry import rotations
from humanmm.models.records.camera import CameraSource

MAX_STEP = 0.4
"""Largest change of ln(focal) taken at once."""
MAX_STEPS = 8
CONVERGED = 0.003
MAX_KEYFRAMES = 24
"""Keyframes of a shot that are used: more would cost time and add little."""
HINT_SHARE = 0.0015
"""A turning camera that fits within this share of the diagonal gives a good first focal length for a moving one."""
MAX_ROUNDS = 2
SAME_FOCAL = 0.05
"""A moving camera is followed anew if its focal length came out further from the first guess than this."""


@dataclass(frozen=True)
class FocalTrack:
    """A camera track with its own focal length."""

    track: Track
    log_focal_sigma: float
    """One sigma of ln(focal), correlation of the errors along a point's track allowed for."""


def with_own_focal(track: Track, freedom: Freedom) -> FocalTrack:
    """The track with the focal length that fits its points best: Newton steps on the focal, all else adjusted after
    each."""
    fixed = np.zeros(len(track.keyframes), bool)
    fixed[0] = True
    solution, observations = track.adjusted, track.observations
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
    return FocalTrack(refined, sigma * _correlation(observations))


@dataclass(frozen=True)
class FocalEvidence:
    """What one shot says about the focal length."""

    focal_px: float
    log_sigma: float
    source: CameraSource


def focal_evidence(shot: TrackedShot, start_px: float) -> FocalEvidence | None:
    """Focal length of a shot whose camera turns or moves, from a first guess; None where it stands or shows too little.

    Of a shot that zooms it is the middle of its range, as uncertain as the zoom is large.
    """
    if shot.num_images < 3 or float(np.median(np.diff(shot.begins))) < MIN_POINTS or judge_standing(shot).static:
        return None
    keyframes = choose_keyframes(shot)[:MAX_KEYFRAMES]
    turning_freedom, moving_freedom = Freedom(translation=False), Freedom(translation=True)
    zooming_freedom = Freedom(translation=False, zoom=True)
    turning = with_own_focal(rotating(shot, keyframes, start_px, freedom=turning_freedom), turning_freedom)
    noise = turning.track.adjusted.noise_px
    if noise < EXACT_SHARE * shot.diagonal_px:
        return _evidence(turning, "rotation_only")
    hint = noise < HINT_SHARE * shot.diagonal_px
    focal_px = turning.track.views.focal_px if hint else start_px
    zooming = rotating(shot, keyframes, focal_px, freedom=zooming_freedom)
    zooms = zooms_in(zooming, turning.track)
    turned_error_px = zooming.error_px if zooms else turning.track.error_px
    found: FocalEvidence | None = None
    zoom_tells = zooms and zooming.adjusted.noise_px < HINT_SHARE * shot.diagonal_px
    if zoom_tells:
        zoomed = with_own_focal(zooming, zooming_freedom)
        found = _evidence(zoomed, "rotation_only")
        focal_px, turned_error_px = zoomed.track.views.focal_px, zoomed.track.error_px
    needs_no_travel = zoom_tells and zoomed.track.adjusted.noise_px < EXACT_SHARE * shot.diagonal_px
    for _ in range(0 if needs_no_travel else MAX_ROUNDS):
        guide = rotating(shot, keyframes, focal_px, freedom=turning_freedom)
        moved = moving(shot, guide, max_starts=1)
        if moved is None:
            break
        if zoom_tells:
            followed = with_own_focal(also_zooming(moved), Freedom(translation=True, zoom=True))
        else:
            followed = with_own_focal(moved, moving_freedom)
        if not followed.track.error_px < MOVING_GAIN * turned_error_px:
            break
        found = _evidence(followed, "tracked")
        if abs(np.log(followed.track.views.focal_px / focal_px)) < SAME_FOCAL:
            break
        focal_px = followed.track.views.focal_px
    if found is None and hint:
        misfit = noise / (EXACT_SHARE * shot.diagonal_px)
        evidence = _evidence(turning, "rotation_only")
        found = replace(evidence, log_sigma=evidence.log_sigma * misfit)
    return found


def _evidence(followed: FocalTrack, source: CameraSource) -> FocalEvidence:
    views = followed.track.views
    middle_px = views.focal_px * float(np.exp(views.log_zoom.mean()))
    sigma = float(np.hypot(followed.log_focal_sigma, np.ptp(views.log_zoom)))
    return FocalEvidence(middle_px, sigma, source)


def _correlation(observations: Observations) -> float:
    """Factor on sigma: a tracker's error stays with the point, so a track counts as one observation, not as many."""
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

    Turns across the optical axis and steps across it shrink by the factor; directions are read anew off each point's
    first sighting.
    """
    across = np.array([1 / factor, 1 / factor, 1.0])
    R_old, t_old = views.R_shot_cam, views.t_shot_cam
    R_new, t_new = R_old.copy(), t_old.copy()
    turns = rotations.rotmat_to_rotvec(np.swapaxes(R_old[:-1], 1, 2) @ R_old[1:])
    steps = np.einsum("kji,kj->ki", R_old[:-1], np.diff(t_old, axis=0))
    for k in range(1, len(R_old)):
        R_new[k] = R_new[k - 1] @ rotations.rotvec_to_rotmat((turns[k - 1] * across)[None])[0]
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
