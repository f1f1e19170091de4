"""Simulated output of a pose network: 33 landmarks in the picture and about the hips, with BlazePose's errors.

Errors are mostly bias: they stay for a second and longer, so that averaging frames gains little, and landmarks of one
limb err together. Limbs are hidden for a while, or jump; left-right swaps last for runs of frames. An error depends on
what the network sees: it decays, and limbs are lost, not with time but with the length of the path that a limb moves
about the middle of the body in the picture, in heights of the body. The error of a foot at rest stays.
"""

import json
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.geometry.projection import in_front, project, ray_axes
from humanmm.models.geometry.rotations import rotvec_to_rotmat, unit
from humanmm.models.records.landmarks import NUM_LANDMARKS, with_sides_swapped
from humanmm.models.weights.shipped import read_weights

Array = np.ndarray

LIMBS = ((13, 15, 17, 19, 21), (14, 16, 18, 20, 22), (25, 27, 29, 31), (26, 28, 30, 32))
"""Landmarks that are hidden or lost together: left and right arm, left and right leg."""
TRUNK = (11, 12, 23, 24)
PARTS = (tuple(range(11)), TRUNK, *LIMBS)
"""Landmarks that go together: the head's, the trunk's, the limbs'."""
BODY = slice(11, 33)
"""Landmarks below the neck."""
NEAR_M = 0.1
"""Landmarks nearer to the camera's plane than this are not seen."""
AXES = 5
"""Of an error: x, y in the picture; x, y, z of the 3D landmark."""

Matrix = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class ErrorPatterns:
    """How errors of landmarks that go together are related: covariances over landmarks × AXES, of the left side (on the
    right x is negative). Over the whole body the mean variance of every axis is 1."""

    trunk: Matrix
    arm: Matrix
    leg: Matrix


@dataclass(frozen=True)
class DetectorNoise:
    """All numbers of the noise; those in use are fitted to rendered clips (`fitted_noise`).

    A *path length* is how far a limb has moved about the middle of the body, heights of the body in the picture. Times
    are means of geometric distributions.
    """

    keypoint_fraction: float
    """Standard deviation of a keypoint per axis, fraction of the body's height in the picture."""
    landmark_deviation_m: tuple[float, float, float]
    """Standard deviation of a 3D landmark along x, y, z of the view."""
    patterns: ErrorPatterns
    rotation_deg: tuple[float, float, float]
    """Standard deviation of the rotation of all 3D landmarks together about x, y, z of the view."""
    tilt_deg: float
    tilt_per_pitch: float
    """The 3D landmarks are tilted about x by `tilt_deg`, and by so much for every degree that the ray points up."""
    lean_per_roll: float
    """The same about z, for every degree of the camera's roll."""
    landmark_scale: float
    """Size of the network's average person over body24's; it gives everybody this size."""
    anatomy_m: float
    """Per axis, how far one person's landmarks lie from where the model has them, in the axes of the joint they
    ride on, for the whole video: the fit must not know the body that it is tested on."""
    new_fraction: float
    """Fraction of the variance in the picture that is new in every frame."""
    shot_fraction: float
    """Fraction of the rest that stays for a whole shot; what is left decays with the path length."""
    memory_path: float
    """Path length after which 1/e of it is left."""
    rest_speed: float
    """The error of a limb at rest changes as if the limb moved so fast, heights a second."""
    hidden_rate: tuple[float, float]
    """How often an arm and a leg are hidden, times per path length."""
    hidden_s: tuple[float, float]
    hidden_factor: float
    """How many times as large the errors of a hidden limb are in the picture."""
    hidden_spread: float
    """Standard deviation of the logarithm of that factor, which is another whenever a limb is hidden: some hidden hands
    are nearly right, others are guessed."""
    hidden_landmark_factor: float
    """The same of the 3D landmarks, always the same."""
    lost_rate: tuple[float, float]
    """How often an arm and a leg jump, times per path length."""
    lost_s: tuple[float, float]
    lost_fraction: float
    """How far they jump, fraction of the body's height."""
    swap_rate: tuple[float, float]
    """How often a left-right swap begins, seen from the front, from behind, times per path length."""
    swap_s: float
    miss_rate: float
    """How often nobody is found, times per path length."""
    miss_s: float


@lru_cache(maxsize=1)
def fitted_noise() -> DetectorNoise:
    """The shipped noise: what `scripts/measure_detector --fit` found (models/weights/detector_noise.md)."""
    noise = json.loads(read_weights("detector_noise.json"))["noise"]
    patterns = {name: tuple(tuple(row) for row in matrix) for name, matrix in noise.pop("patterns").items()}
    values: dict[str, Any] = {name: tuple(v) if isinstance(v, list) else v for name, v in noise.items()}
    return DetectorNoise(**values, patterns=ErrorPatterns(**patterns))


@dataclass(frozen=True)
class Detections:
    """One person in one clip of n frames."""

    keypoints: Float[Array, "n 33 3"]
    """Source pixels, visibility."""
    landmarks: Float[Array, "n 33 3"]
    """Metres about the mid-hip, axes parallel to the viewing ray of the mid-hip."""
    found: Bool[Array, " n"]
    """False where the detector missed the person, or the picture does not hold enough of them."""
    swapped: Bool[Array, " n"]
    """Frames with a left-right swap; only tests read this."""


def detect(
    points: Float[Array, "n 33 3"],
    K: Float[Array, "*n 3 3"],
    size: tuple[int, int],
    behind: Bool[Array, " n"],
    stature: float,
    fps: float,
    noise: DetectorNoise,
    rng: np.random.Generator,
    *,
    pitch: Float[Array, " n"],
    roll: Float[Array, " n"],
) -> Detections:
    """Noisy landmarks of a body whose true ones are `points` (camera axes, metres).

    `K`: one for all frames, or one a frame; `behind`: the camera sees the back; `stature`: the person's size over the
    average's; `pitch`: the viewing ray above the horizon, `roll`: of the camera about its axis, clockwise, radians.
    """
    n = len(points)
    pixels = project(points, K, near_m=NEAR_M)
    height = np.ptp(pixels[..., 1], axis=1)[:, None, None]
    steps = speeds(pixels, fps) / fps + noise.rest_speed / fps
    of_limbs, of_body = steps[:, 2:].T, steps[:, 1:].mean(axis=1)
    pairs = list(zip(of_limbs, (0, 0, 1, 1), strict=True))
    hidden = np.stack([_runs(rng, path, noise.hidden_rate[k], noise.hidden_s[k], fps) for path, k in pairs])
    lost = np.stack([_runs(rng, path, noise.lost_rate[k], noise.lost_s[k], fps) for path, k in pairs])
    factor, factor_3d = np.ones((2, n, NUM_LANDMARKS, 1))
    jump = np.zeros((n, NUM_LANDMARKS, 2))
    visibility = 0.97 - 0.04 * np.abs(rng.normal(size=(n, NUM_LANDMARKS)))
    visibility[behind, :11] -= 0.25
    factor[behind, :11] = noise.hidden_factor
    factor_3d[behind, :11] = noise.hidden_landmark_factor
    for limb, gone, wild in zip(LIMBS, hidden, lost, strict=True):
        factor[:, limb] = _hidden_factors(rng, gone, noise)[:, None, None]
        factor_3d[np.ix_(gone, limb)] = noise.hidden_landmark_factor
        visibility[np.ix_(gone, limb)] = rng.uniform(0.2, 0.5)
        jump[np.ix_(wild, limb)] = noise.lost_fraction * unit(rng.normal(size=2))
    wrong = _landmark_errors(rng, steps, noise)
    pixels = pixels + height * (noise.keypoint_fraction * factor * wrong[..., :2] + jump)
    inside = ((pixels > 0) & (pixels < np.array(size))).all(axis=-1) & in_front(points, NEAR_M)
    visibility = np.where(inside, visibility, 0.1)

    about_hips = points - points[:, 23:25].mean(axis=1, keepdims=True)
    ray = points[:, 23:25].mean(axis=1)
    R_cam_ray = ray_axes(ray)
    rotation = np.deg2rad(np.array(noise.rotation_deg)) * _errors(rng, of_body, 3, noise)
    rotation[:, 0] += np.deg2rad(noise.tilt_deg) + noise.tilt_per_pitch * pitch
    rotation[:, 2] += noise.lean_per_roll * roll
    solid = np.einsum("nba,njb->nja", R_cam_ray, about_hips) @ np.swapaxes(rotvec_to_rotmat(rotation), -1, -2)
    solid *= noise.landmark_scale / stature
    solid += factor_3d * np.array(noise.landmark_deviation_m) * wrong[..., 2:]
    solid -= solid[:, 23:25].mean(axis=1, keepdims=True)

    front, back = (_runs(rng, of_body, rate, noise.swap_s, fps) for rate in noise.swap_rate)
    swapped = np.where(behind, back, front)
    keypoints = np.concatenate([pixels, visibility[..., None]], axis=-1)
    keypoints, solid = (with_sides_swapped(points, swapped) for points in (keypoints, solid))
    found = ~_runs(rng, of_body, noise.miss_rate, noise.miss_s, fps)
    found &= inside[:, [11, 12, 23, 24]].all(axis=1) & (inside.mean(axis=1) > 0.5)
    return Detections(keypoints.astype(np.float32), solid.astype(np.float32), found, swapped)


def pitch_and_roll(
    R_world_cam: Float[Array, "n 3 3"], ray: Float[Array, "n 3"]
) -> tuple[Float[Array, " n"], Float[Array, " n"]]:
    """Of viewing rays (camera axes): above the horizon, and the camera's clockwise rotation about them."""
    down = -R_world_cam[:, 2]  # the world's −z in camera axes
    seen = np.einsum("nba,nb->na", ray_axes(ray), down)
    return np.arcsin(np.clip(-seen[:, 2], -1, 1)), np.arctan2(seen[:, 0], seen[:, 1])


def speeds(pixels: Float[Array, "n 33 2"], fps: float) -> Float[Array, "n parts"]:
    """Mean speed of the landmarks of every one of PARTS about the middle of the body, heights of the body a second."""
    if len(pixels) < 2:
        return np.zeros((len(pixels), len(PARTS)))
    height = np.ptp(pixels[..., 1], axis=1)[:, None, None]
    about_body = (pixels - np.median(pixels[:, BODY], axis=1, keepdims=True)) / np.maximum(height, 1e-6)
    speed = np.linalg.norm(np.diff(about_body, axis=0), axis=-1) * fps
    of_parts = np.stack([speed[:, part].mean(axis=1) for part in PARTS], axis=1)
    return np.concatenate([of_parts[:1], of_parts])


def _landmark_errors(
    rng: np.random.Generator, steps: Float[Array, "n parts"], noise: DetectorNoise
) -> Float[Array, "n 33 5"]:
    """Errors of all landmarks, of unit variance on average, related as the patterns say."""
    errors = np.empty((len(steps), NUM_LANDMARKS, AXES))
    factors = _factors(noise.patterns)
    mirrored = np.array([-1.0, 1, -1, 1, 1])
    for number, (part, factor) in enumerate(zip(PARTS, factors, strict=True)):
        independent = _errors(rng, steps[:, number], AXES * len(part), noise)
        related = (independent if factor is None else independent @ factor.T).reshape(len(steps), len(part), AXES)
        errors[:, part] = related * mirrored if part in (LIMBS[1], LIMBS[3]) else related
    new = rng.normal(size=errors[..., :2].shape)
    errors[..., :2] = np.sqrt(1 - noise.new_fraction) * errors[..., :2] + np.sqrt(noise.new_fraction) * new
    return errors


@lru_cache(maxsize=4)
def _factors(patterns: ErrorPatterns) -> tuple[Array | None, ...]:
    """A root of the covariance of every one of PARTS; None where all is independent."""
    trunk, arm, leg = (_root(np.array(matrix)) for matrix in (patterns.trunk, patterns.arm, patterns.leg))
    return None, trunk, arm, arm, leg, leg


def _root(covariance: Float[Array, "d d"]) -> Float[Array, "d d"]:
    size, axes = np.linalg.eigh(covariance)
    return np.asarray(axes * np.sqrt(np.maximum(size, 0)))


def _errors(
    rng: np.random.Generator, steps: Float[Array, " n"], count: int, noise: DetectorNoise
) -> Float[Array, "n count"]:
    """Noise of unit variance, one part constant, one that decays; `steps`: path lengths from the frame before."""
    constant = np.sqrt(noise.shot_fraction) * rng.normal(size=(1, count))
    return np.asarray(constant + np.sqrt(1 - noise.shot_fraction) * _remembering(rng, steps / noise.memory_path, count))


def _remembering(rng: np.random.Generator, steps: Float[Array, " n"], count: int) -> Float[Array, "n count"]:
    """First-order autoregressive noise of unit variance; `steps` from frame to frame in lengths of its memory."""
    error = rng.normal(size=(len(steps), count))
    keep = np.exp(-steps)
    drive = np.sqrt(1 - keep * keep)
    for row in range(1, len(error)):
        error[row] = keep[row] * error[row - 1] + drive[row] * error[row]
    return error


def _hidden_factors(rng: np.random.Generator, gone: Bool[Array, " n"], noise: DetectorNoise) -> Float[Array, " n"]:
    """By how much a limb's errors in the picture are larger: one factor for each run of frames in which it is hidden,
    1 elsewhere."""
    run = np.cumsum(np.diff(gone, prepend=False) & gone)
    of_run = noise.hidden_factor * np.exp(noise.hidden_spread * rng.normal(size=int(run.max(initial=0)) + 1))
    return np.where(gone, of_run[run], 1.0)


def _runs(
    rng: np.random.Generator, steps: Float[Array, " n"], rate: float, mean_s: float, fps: float
) -> Bool[Array, " n"]:
    """Frames inside events that begin at a rate per path length and last a while; the first may have begun before."""
    lead = round(4 * mean_s * fps)
    path = np.cumsum(np.concatenate([np.full(lead, steps.mean()), steps]))
    inside = np.zeros(len(path), bool)
    for _ in range(rng.poisson(rate * path[-1])):
        first = int(np.searchsorted(path, rng.uniform(0, path[-1])))
        inside[first : first + rng.geometric(min(1.0, 1 / (mean_s * fps)))] = True
    return inside[lead:]
