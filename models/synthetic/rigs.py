"""Virtual cameras: a ring of nine about the scene, as in AIST, each static or moving for the length of a clip.

Camera axes: x right, y down, z forward. World: z up, metres.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d

from humanmm.models.geometry.intrinsics import K_from_focal
from humanmm.models.geometry.rotations import rotvec_to_rotmat

Array = np.ndarray

Kind = Literal["static", "pan", "dolly", "hand-held", "orbit"]
KINDS: tuple[Kind, ...] = ("static", "pan", "dolly", "hand-held", "orbit")
PROBABILITIES = (0.6, 0.1, 0.1, 0.1, 0.1)
"""How often a clip has each kind of camera. AIST's cameras are all static; those of edited videos mostly are."""

NUM_CAMERAS = 9
WIDTH, HEIGHT = 1920, 1080
FOCAL_PER_DIAGONAL = (0.65, 1.0)
"""28 to 43 mm full-frame equivalent."""
LOOK_AT_M = 0.9
HEADROOM_M = 1.3
"""Half of what the picture must hold above and below the look-at point at the nearest position."""


@dataclass(frozen=True)
class Ring:
    """Nine positions about a centre that all look inwards; one focal length (the paper's assumption)."""

    centre: Float[Array, "3"]
    eyes: Float[Array, "9 3"]
    focal_px: float

    @property
    def K(self) -> Float[Array, "3 3"]:  # noqa: N802
        """Pixels with centres at .5."""
        return K_from_focal(self.focal_px, WIDTH, HEIGHT)


@dataclass(frozen=True)
class ClipCamera:
    """The camera of one clip of n frames."""

    kind: Kind
    R_world_cam: Float[Array, "n 3 3"]
    t_world_cam: Float[Array, "n 3"]


def build_ring(pelvis: Float[Array, "N 3"], rng: np.random.Generator) -> Ring:
    """A ring from which the whole sequence is in view."""
    centre = np.append((pelvis[:, :2].min(axis=0) + pelvis[:, :2].max(axis=0)) / 2, LOOK_AT_M)
    reach = float(np.linalg.norm(pelvis[:, :2] - centre[:2], axis=1).max())
    focal = rng.uniform(*FOCAL_PER_DIAGONAL) * math.hypot(WIDTH, HEIGHT)
    across, upright = 0.85 * WIDTH / 2 / focal, HEIGHT / 2 / focal
    radius = max(reach / across, reach + HEADROOM_M / upright)
    azimuth = (np.arange(NUM_CAMERAS) + rng.uniform(-0.2, 0.2, NUM_CAMERAS)) * (2 * np.pi / NUM_CAMERAS)
    azimuth += rng.uniform(0, 2 * np.pi)
    distance = radius * rng.uniform(1.0, 1.25, NUM_CAMERAS)
    eyes = np.stack(
        [np.cos(azimuth) * distance, np.sin(azimuth) * distance, rng.uniform(0.1, 1.3, NUM_CAMERAS)], axis=1
    )
    return Ring(centre, centre * [1, 1, 0] + eyes + [0, 0, 0.7], float(focal))


def look_at(eye: Float[Array, "*n 3"], target: Float[Array, "*n 3"]) -> Float[Array, "*n 3 3"]:
    """R_world_cam of level cameras at `eye` that look at `target`."""
    z = target - eye
    z = z / np.linalg.norm(z, axis=-1, keepdims=True)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x = x / np.linalg.norm(x, axis=-1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=-1)


def move_camera(
    position: Float[Array, "3"],
    centre: Float[Array, "3"],
    kind: Kind,
    pelvis: Float[Array, "n 3"],
    fps: float,
    rng: np.random.Generator,
) -> ClipCamera:
    """The path of a camera that starts at `position`, looks at `centre`, and may follow the person's `pelvis`."""
    n = len(pelvis)
    eye, target = np.tile(position, (n, 1)), np.tile(centre, (n, 1))
    away = (np.arange(n) - (n - 1) / 2) / fps
    shake = np.zeros((n, 3))
    if kind == "pan":  # a tripod whose head follows the person, a little late
        followed = gaussian_filter1d(pelvis, 0.4 * fps, axis=0, mode="nearest")
        target[:, :2] = followed[:, :2]
    elif kind == "dolly":  # a straight track across the view, the head fixed
        R = look_at(eye[0], target[0])
        speed = rng.uniform(0.2, 0.7) * rng.choice([-1.0, 1.0])
        slide = R[:, 0] * speed
        eye += away[:, None] * slide
        target += away[:, None] * slide
    elif kind == "hand-held":  # breathing hands and shoulders: centimetres and a degree, below 2 Hz
        eye += 0.04 * wander(rng, n, 0.4 * fps)
        shake = np.deg2rad(1.2) * wander(rng, n, 0.3 * fps)
    elif kind == "orbit":
        yaw = np.deg2rad(rng.uniform(8.0, 20.0)) * rng.choice([-1.0, 1.0]) * away
        arm = eye - target
        c, s = np.cos(yaw), np.sin(yaw)
        eye = target + np.stack([c * arm[:, 0] - s * arm[:, 1], s * arm[:, 0] + c * arm[:, 1], arm[:, 2]], axis=1)
    return ClipCamera(kind, look_at(eye, target) @ rotvec_to_rotmat(shake), eye)


def wander(rng: np.random.Generator, n: int, sigma_frames: float) -> Float[Array, "n 3"]:
    """Smooth noise of about unit variance."""
    margin = math.ceil(4 * sigma_frames)
    rough = rng.normal(size=(n + 2 * margin, 3))
    smooth = gaussian_filter1d(rough, sigma_frames, axis=0)[margin : margin + n]
    return np.asarray(smooth * math.sqrt(2 * math.sqrt(math.pi) * sigma_frames))
