"""The cameras of a clip: static, panning, hand-held, flying and zooming cameras, and some that pass near objects."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.rendering.script import CLEAR_M, LEAST_IN_VIEW, Shot, in_view
from humanmm.models.synthetic.mocap import Actor
from humanmm.models.synthetic.rigs import Kind, look_at, move_camera, wander

Array = np.ndarray

CameraKind = Literal["static", "pan", "dolly", "hand-held", "orbit", "rolling", "drone", "past objects"]
CAMERA_KINDS: tuple[CameraKind, ...] = (
    "static",
    "pan",
    "dolly",
    "hand-held",
    "orbit",
    "rolling",
    "drone",
    "past objects",
)
PROBABILITIES = (0.24, 0.14, 0.1, 0.14, 0.1, 0.1, 0.09, 0.09)
_RIGS: dict[str, Kind] = {"past objects": "dolly", "rolling": "hand-held", "drone": "orbit"}
PERSON_M = 1.7
ZOOMED = 0.15


@dataclass(frozen=True)
class Lens:
    """What all shots of a clip share."""

    width: int
    height: int
    focal_px: float
    fps: float


def film_shot(
    actors: list[Actor], span: tuple[int, int], azimuth: float, kind: CameraKind, lens: Lens, rng: np.random.Generator
) -> Shot:
    """A camera of this kind at this azimuth that holds the first actor, far enough from everybody."""
    n = span[1] - span[0]
    pelvis = actors[0].joints[slice(*span), 0]
    middle = (pelvis[:, :2].min(axis=0) + pelvis[:, :2].max(axis=0)) / 2
    centre = np.append(middle, 0.45 + 0.55 * float(np.median(pelvis[:, 2])))
    height = rng.uniform(*((0.9, 1.8), (1.8, 3.2), (0.25, 0.9))[int(rng.choice(3, p=[0.6, 0.22, 0.18]))])
    roll = np.deg2rad(rng.normal(0, 1.5 if rng.random() < 0.75 else 8.0))
    filled = rng.uniform(0.36, 0.85) if lens.height < lens.width else rng.uniform(0.3, 0.65)
    if kind == "drone":
        height, filled, roll = rng.uniform(3.5, 8.0), rng.uniform(0.25, 0.5), 0.0
    distance = max(2.0, PERSON_M * lens.focal_px / (filled * lens.height))
    zooms = rng.random() < ZOOMED
    ramp = np.linspace(1.0, rng.uniform(1.2, 1.7), n) if zooms else np.ones(n)
    ramp = ramp[::-1] if zooms and rng.random() < 0.5 else ramp
    gain = rng.uniform(0.65, 1.3) * rng.uniform(0.93, 1.07, 3)
    state = rng.bit_generator.state
    shot = None
    for _ in range(14):
        rng.bit_generator.state = state  # the same movement from farther away
        ground = math.sqrt(max(distance**2 - (height - centre[2]) ** 2, (0.45 * distance) ** 2))
        eye = np.append(middle + ground * np.array([np.cos(azimuth), np.sin(azimuth)]), height)
        camera = move_camera(eye, centre, _RIGS.get(kind, kind), pelvis, lens.fps, rng)  # type: ignore[arg-type]
        R, t = camera.R_world_cam, camera.t_world_cam
        if kind == "drone":
            t = t + np.linspace(0, 1, n)[:, None] * rng.uniform([-1.5, -1.5, -1.0], [1.5, 1.5, 1.5])
            R = look_at(t, np.tile(centre, (n, 1)))
        if kind == "rolling":
            shake = wander(rng, n, 0.22 * lens.fps) * np.deg2rad([2.0, 2.0, 5.0])
            R, t = R @ rotvec_to_rotmat(shake), t + 0.06 * wander(rng, n, 0.25 * lens.fps)
        R = R @ rotvec_to_rotmat(np.array([0.0, 0.0, roll]))
        shot = Shot(*span, f"{kind}, zoom" if zooms else kind, R, t, lens.focal_px * ramp, gain)
        if holds(actors, shot, lens):
            break
        distance *= 1.12
    assert shot is not None
    return shot


def again(shot: Shot, span: tuple[int, int], rng: np.random.Generator, *, rotated_deg: float = 0.0) -> Shot:
    """The camera of a shot where it stood at the end, or a little rotated; it does not move now."""
    n = span[1] - span[0]
    R = shot.R_world_cam[-1] @ rotvec_to_rotmat(np.deg2rad([0.0, rotated_deg, 0.0]))
    return Shot(
        *span, "static", np.tile(R, (n, 1, 1)), np.tile(shot.t_world_cam[-1], (n, 1)),
        np.full(n, shot.focal_px[-1]), shot.gain * rng.uniform(0.97, 1.03),
    )  # fmt: skip


def holds(actors: list[Actor], shot: Shot, lens: Lens) -> bool:
    """Whether nobody is too near, and the first actor is in the picture."""
    rows = slice(shot.start, shot.end)
    gaps = [np.linalg.norm((actor.joints[rows, 0] - shot.t_world_cam)[:, :2], axis=1).min() for actor in actors]
    return min(gaps) > CLEAR_M and fraction_in_view(actors[0].joints[rows], shot, lens) >= LEAST_IN_VIEW


def fraction_in_view(joints: Float[Array, "n 24 3"], shot: Shot, lens: Lens) -> float:
    """Fraction of joints in the picture."""
    size = (lens.width, lens.height)
    pixels, depth = in_view(joints, shot, slice(None), size)
    return float(((pixels > 0).all(-1) & (pixels < size).all(-1) & (depth > 0.3)).mean())
