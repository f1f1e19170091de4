"""What a pose network makes of a body: 33 landmarks in the picture and about the hips, wrong the way BlazePose is.

Errors are mostly bias: they stay for half a second and longer, so that averaging frames gains little. Whole limbs are
hidden for a while, jump for a frame or two, and left and right are exchanged for whole runs of frames, above all from
behind.
"""

import json
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.body.landmarks import MIRROR, NUM_LANDMARKS
from humanmm.models.rotations import rotation_from_vector, swing
from humanmm.models.weights.shipped import read_weights

Array = np.ndarray

LIMBS = (
    (13, 15, 17, 19, 21), (14, 16, 18, 20, 22), (25, 27, 29, 31), (26, 28, 30, 32),
)  # fmt: skip
"""Landmarks that are hidden or lost together: left and right arm, left and right leg."""


@dataclass(frozen=True)
class DetectorNoise:
    """All numbers of the noise; those in use are fitted to rendered clips (`fitted_noise`).

    Lengths of time are means of exponential distributions.
    """

    keypoint_share: float
    """One sigma of a keypoint per axis, share of the body's height in the picture."""
    landmark_sigma_m: tuple[float, float, float]
    """Of a 3D landmark, along x, y, z of the view."""
    turn_deg: tuple[float, float, float]
    """Of all 3D landmarks together, about x, y, z of the view."""
    tilt_deg: float
    tilt_per_pitch: float
    """The 3D landmarks are tilted about x by `tilt_deg` and so many degrees for every degree that the ray points up."""
    lean_per_roll: float
    """The same about z, for every degree of the camera's roll."""
    landmark_scale: float
    """Size of the network's average person against body24's; it draws everybody as large as that."""
    anatomy_m: float
    """Per axis, how far one person's landmarks lie from where the model has them, in the axes of the joint they
    ride on, for the whole video: the fit must not know the body that it is tested on."""
    shot_share: float
    slow_share: float
    """Shares of the variance that stay for a whole shot, and that change slowly; the rest is quick."""
    slow_s: float
    quick_s: float
    hidden_hz: float
    """How often a limb is hidden, a second."""
    hidden_s: float
    hidden_factor: float
    outlier_hz: float
    """How often a limb jumps, a second."""
    outlier_s: float
    outlier_share: float
    """How far, share of the body's height."""
    swap_hz: tuple[float, float]
    """How often left and right are exchanged: seen from the front, from behind."""
    swap_s: float
    miss_hz: float
    miss_s: float


@lru_cache(maxsize=1)
def fitted_noise() -> DetectorNoise:
    """The shipped noise: what `scripts/measure_detector --fit` found (models/weights/detector_noise.md)."""
    noise = json.loads(read_weights("detector_noise.json"))["noise"]
    values: dict[str, Any] = {name: tuple(v) if isinstance(v, list) else v for name, v in noise.items()}
    return DetectorNoise(**values)


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
    """Where left and right are exchanged; nobody but a test is told."""


def detect(
    points: Float[Array, "n 33 3"],
    K: Float[Array, "3 3"],
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

    `behind`: the camera sees the back; `stature`: the person's size over the average's; `pitch`: the viewing ray above
    the horizon, `roll`: of the camera about its axis, clockwise, radians.
    """
    n = len(points)
    depth = np.maximum(points[..., 2:], 0.1)
    pixels = (points @ K.T)[..., :2] / depth
    height = np.ptp(pixels[..., 1], axis=1)[:, None, None]
    hidden = np.stack([_runs(rng, n, noise.hidden_hz, noise.hidden_s, fps) for _ in LIMBS])
    lost = np.stack([_runs(rng, n, noise.outlier_hz, noise.outlier_s, fps) for _ in LIMBS])
    factor, jump = np.ones((n, NUM_LANDMARKS, 1)), np.zeros((n, NUM_LANDMARKS, 2))
    visibility = 0.97 - 0.04 * np.abs(rng.normal(size=(n, NUM_LANDMARKS)))
    visibility[behind, :11] -= 0.25
    factor[behind, :11] = noise.hidden_factor
    for limb, gone, wild in zip(LIMBS, hidden, lost, strict=True):
        factor[np.ix_(gone, limb)] = noise.hidden_factor
        visibility[np.ix_(gone, limb)] = rng.uniform(0.2, 0.5)
        jump[np.ix_(wild, limb)] = noise.outlier_share * _unit(rng.normal(size=2))
    wrong = _errors(rng, n, (NUM_LANDMARKS, 2), fps, noise)
    pixels = pixels + height * (noise.keypoint_share * factor * wrong + jump)
    inside = ((pixels > 0) & (pixels < np.array(size))).all(axis=-1) & (points[..., 2] > 0.1)
    visibility = np.where(inside, visibility, 0.1)

    about_hips = points - points[:, 23:25].mean(axis=1, keepdims=True)
    ray = points[:, 23:25].mean(axis=1)
    R_cam_ray = swing(np.broadcast_to([0.0, 0.0, 1.0], ray.shape), ray)
    turn = np.deg2rad(np.array(noise.turn_deg)) * _errors(rng, n, (3,), fps, noise)
    turn[:, 0] += np.deg2rad(noise.tilt_deg) + noise.tilt_per_pitch * pitch
    turn[:, 2] += noise.lean_per_roll * roll
    solid = np.einsum("nba,njb->nja", R_cam_ray, about_hips) @ np.swapaxes(rotation_from_vector(turn), -1, -2)
    solid *= noise.landmark_scale / stature
    solid += factor * np.array(noise.landmark_sigma_m) * _errors(rng, n, (NUM_LANDMARKS, 3), fps, noise)
    solid -= solid[:, 23:25].mean(axis=1, keepdims=True)

    front, back = (_runs(rng, n, hz, noise.swap_s, fps) for hz in noise.swap_hz)
    swapped = np.where(behind, back, front)
    keypoints = np.concatenate([pixels, visibility[..., None]], axis=-1)
    keypoints[swapped] = keypoints[swapped][:, list(MIRROR)]
    solid[swapped] = solid[swapped][:, list(MIRROR)]
    found = ~_runs(rng, n, noise.miss_hz, noise.miss_s, fps)
    found &= inside[:, [11, 12, 23, 24]].all(axis=1) & (inside.mean(axis=1) > 0.5)
    return Detections(keypoints.astype(np.float32), solid.astype(np.float32), found, swapped)


def pitch_and_roll(
    R_world_cam: Float[Array, "n 3 3"], ray: Float[Array, "n 3"]
) -> tuple[Float[Array, " n"], Float[Array, " n"]]:
    """Of viewing rays (camera axes): above the horizon, and how far the camera is turned clockwise about them."""
    down = -R_world_cam[:, 2]  # the world's −z in camera axes
    R_cam_ray = swing(np.broadcast_to([0.0, 0.0, 1.0], ray.shape), ray)
    seen = np.einsum("nba,nb->na", R_cam_ray, down)
    return np.arcsin(np.clip(-seen[:, 2], -1, 1)), np.arctan2(seen[:, 0], seen[:, 1])


def _errors(
    rng: np.random.Generator, n: int, shape: tuple[int, ...], fps: float, noise: DetectorNoise
) -> Float[Array, "n *shape"]:
    """Noise of unit variance: a constant, a slow and a quick part."""
    quick = 1.0 - noise.shot_share - noise.slow_share
    constant = np.sqrt(noise.shot_share) * rng.normal(size=(1, *shape))
    slow = np.sqrt(noise.slow_share) * _remembering(rng, n, shape, noise.slow_s * fps)
    return np.asarray(constant + slow + np.sqrt(quick) * _remembering(rng, n, shape, noise.quick_s * fps))


def _remembering(
    rng: np.random.Generator, n: int, shape: tuple[int, ...], memory_frames: float
) -> Float[Array, "n *shape"]:
    """First-order autoregressive noise of unit variance."""
    from scipy.signal import lfilter  # slow to import, and a repeat from the store makes no video

    keep = float(np.exp(-1.0 / memory_frames))
    drive = rng.normal(size=(n, *shape))
    drive[1:] *= np.sqrt(1 - keep * keep)
    return np.asarray(lfilter([1.0], [1.0, -keep], drive, axis=0))


def _runs(rng: np.random.Generator, n: int, rate_hz: float, mean_s: float, fps: float) -> Bool[Array, " n"]:
    """Frames inside events that begin at a rate and last for a while; one may be on when the clip begins."""
    inside = np.zeros(n, bool)
    lead = 4 * mean_s
    for _ in range(rng.poisson(rate_hz * (n / fps + lead))):
        start = rng.uniform(-lead, n / fps)
        first, last = round(start * fps), round((start + rng.exponential(mean_s)) * fps)
        inside[max(first, 0) : max(last, first + 1, 0)] = True
    return inside


def _unit(v: Array) -> Array:
    return np.asarray(v / np.linalg.norm(v))
