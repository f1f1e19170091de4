"""The pelvis' way through the world: what the cameras saw, and the feet that stood, in one banded solve.

A single camera sees a person's direction well and the distance badly, and the error of the distance lasts for many
frames. A planted foot does not move: through the leg it tells how the pelvis moved, exactly where the camera is blind.
(The paper's trajectory refiner, section 3.3.3, learns this; here it is written down.)
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.motion.refine_smoothing import ORDER, Roughness, frame_weights, solve_banded

Array = np.ndarray


@dataclass(frozen=True)
class TrajectoryNoise:
    """Expected errors. Those of the pelvis last: `lasting_frames` (at 30 Hz) are worth one independent one."""

    across_m: float = 0.02
    """Pelvis across the viewing ray, metres, at least."""
    depth_share: float = 0.04
    """Pelvis along the viewing ray, as a share of the distance."""
    lasting_frames: float = 10.0
    foot_speed_ms: float = 0.12
    """Speed that a planted foot seems to have by the pose alone, m/s."""
    floor_m: float = 0.06
    """Height of a planted sole above the floor."""
    robust: float = 2.0
    """Residual, in sigmas, beyond which a contact loses its say."""
    cutoff_hz: float = 5.0
    """Band limit of the pelvis across the viewing ray."""


def solve_trajectory(
    pelvis: Float[Array, "N 3"],
    feet_from_pelvis: Float[Array, "N 4 3"],
    contacts: Float[Array, "N 4"],
    sole_height: Float[Array, " 4"],
    *,
    camera_centre: Float[Array, "N 3"],
    observed: Bool[Array, " N"],
    time_s: Float[Array, " N"],
    noise: TrajectoryNoise | None = None,
    iterations: int = 4,
) -> Float[Array, "N 3"]:
    """(N,3) pelvis in the world, z up, floor at 0, metres, from its estimate and the contacts (probabilities)."""
    noise = noise or TrajectoryNoise()
    n = len(pelvis)
    if n <= ORDER or not observed.any():
        return pelvis.copy()
    weight = frame_weights(time_s)
    base = _evidence(pelvis, camera_centre, weight * observed / noise.lasting_frames, noise)
    rough = Roughness.of(time_s, observed, cutoff_hz=noise.cutoff_hz).diagonals
    rough *= 1 / (noise.lasting_frames * noise.across_m**2)
    known = np.where(observed[:, None], pelvis, 0.0)
    planted = contacts * (contacts >= 0.5)
    step = planted[1:] * planted[:-1] * (observed[1:] & observed[:-1])[:, None]
    span = np.diff(time_s)
    drift = np.diff(feet_from_pelvis, axis=0)  # of the foot by the pose alone: the pelvis must undo it
    step_information = 1 / (noise.foot_speed_ms * np.maximum(span, 1e-4)) ** 2 * (span * 30.0)
    rest = sole_height - feet_from_pelvis[..., 2]  # height of the pelvis at which the sole is on the floor
    path = pelvis
    for _ in range(iterations):
        moved = np.diff(path, axis=0)[:, None] + drift
        squared = np.sum(moved**2, axis=-1) / (noise.foot_speed_ms * span[:, None]) ** 2
        trust = step * step_information[:, None] / (1 + squared / noise.robust**2)
        above = (path[:, 2:] - rest) / noise.floor_m
        floor_trust = planted * weight[:, None] / noise.floor_m**2 / (1 + (above / noise.robust) ** 2) ** 2
        floor_trust *= observed[:, None] / noise.lasting_frames
        path = _solve(base, known, rough, trust, drift, floor_trust, rest)
    return path


def _evidence(pelvis: Array, camera_centre: Array, weight: Array, noise: TrajectoryNoise) -> Float[Array, "N 3 3"]:
    """Information matrix of each frame's pelvis: sharp across the viewing ray, blunt along it."""
    way = pelvis - camera_centre
    distance = np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 0.5)
    ray = way / distance
    along = ray[:, :, None] * ray[:, None, :]
    depth_m = np.maximum(noise.depth_share * distance[..., None], noise.across_m)
    return np.asarray(weight[:, None, None] * ((np.eye(3) - along) / noise.across_m**2 + along / depth_m**2))


def _solve(
    base: Float[Array, "N 3 3"],
    pelvis: Float[Array, "N 3"],
    rough: Float[Array, "4 N"],
    trust: Float[Array, "M 4"],
    drift: Float[Array, "M 4 3"],
    floor_trust: Float[Array, "N 4"],
    rest: Float[Array, "N 4"],
) -> Float[Array, "N 3"]:
    """Normal equations of the three coordinates, interleaved: entry 3 t + axis."""
    n = len(pelvis)
    upper = np.zeros((3 * ORDER + 1, 3 * n))
    right = (base @ pelvis[..., None])[..., 0]
    for k in range(ORDER + 1):
        upper[3 * k] += np.repeat(rough[k], 3)
    for a in range(3):
        for b in range(a, 3):
            upper[b - a, a::3] += base[:, a, b]
    total = trust.sum(axis=1)
    for axis in range(3):
        upper[0, axis::3][:-1] += total
        upper[0, axis::3][1:] += total
        upper[3, axis::3][:-1] -= total
    pull = np.sum(trust[..., None] * drift, axis=1)
    right[:-1] += pull
    right[1:] -= pull
    upper[0, 2::3] += floor_trust.sum(axis=1)
    right[:, 2] += np.sum(floor_trust * rest, axis=1)
    upper[0] += 1e-9 * upper[0].max()
    return solve_banded(upper, right.reshape(-1, 1)).reshape(n, 3)
