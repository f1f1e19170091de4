"""Synthetic shots with known cameras: random points before a static, rotating or moving camera."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from humanmm.models.records.camera import Intrinsics, PointTracks

WIDTH, HEIGHT, FOCAL = 960, 540, 900.0


@dataclass(frozen=True)
class Scene:
    """Observations, and the truth they were made from (first camera = shot frame)."""

    points: PointTracks
    intrinsics: Intrinsics
    R_shot_cam: np.ndarray
    t_shot_cam: np.ndarray


def path(kind: str, num_frames: int) -> tuple[np.ndarray, np.ndarray]:
    """Rotations and centres of a camera 6 m before the middle of a scene."""
    time = np.linspace(0.0, 1.0, num_frames)
    still = np.zeros((num_frames, 3))
    if kind == "static":
        return np.tile(np.eye(3), (num_frames, 1, 1)), still
    if kind == "pan":
        return Rotation.from_euler("y", 35.0 * time[:, None], degrees=True).as_matrix(), still
    if kind == "dolly":
        turn = Rotation.from_euler("y", -8.0 * time[:, None], degrees=True).as_matrix()
        return turn, np.stack([1.5 * time, 0 * time, 0.5 * time], 1)
    if kind == "sideways":
        return np.tile(np.eye(3), (num_frames, 1, 1)), np.stack([2.0 * time, 0 * time, 0 * time], 1)
    if kind == "orbit":
        angle = np.radians(40.0) * time
        centre = np.stack([-6 * np.sin(angle), 0 * time, 6 - 6 * np.cos(angle)], 1)
        return Rotation.from_euler("y", angle[:, None]).as_matrix(), centre
    if kind == "forward":
        return np.tile(np.eye(3), (num_frames, 1, 1)), np.stack([0 * time, 0 * time, 2.0 * time], 1)
    if kind == "hand-held":
        phase = 2 * np.pi * time[:, None] * [1.3, 1.7, 0.9] * num_frames / 30
        turn = Rotation.from_euler("yxz", [5.0, 3.0, 1.5] * np.sin(phase), degrees=True).as_matrix()
        sway = [0.25, 0.15, 0.12] * np.sin(0.8 * phase + [0.0, 1.0, 2.0])
        return turn[0].T @ turn, (sway - sway[0]) @ turn[0]
    raise ValueError(kind)


def make_scene(
    kind: str,
    *,
    num_frames: int = 60,
    noise_px: float = 0.3,
    outliers: float = 0.05,
    num_points: int = 600,
    seed: int = 0,
) -> Scene:
    """Points on a floor, a back wall and in between, seen by the camera of `kind`; some tracks wander off at random."""
    rng = np.random.default_rng(seed)
    R, t = path(kind, num_frames)
    floor = np.stack([rng.uniform(-9, 9, num_points), np.full(num_points, 1.5), rng.uniform(2, 12, num_points)], 1)
    wall = np.stack([rng.uniform(-14, 14, num_points), rng.uniform(-5, 1.5, num_points), np.full(num_points, 12.0)], 1)
    space = rng.uniform([-9, -3, 3], [9, 1.5, 11], (num_points, 3))
    X = np.concatenate([floor, wall, space])
    q = np.einsum("fji,fpj->fpi", R, X[None] - t[:, None])
    with np.errstate(divide="ignore", invalid="ignore"):
        xy = FOCAL * q[..., :2] / q[..., 2:] + (WIDTH / 2, HEIGHT / 2)
    visible = (q[..., 2] > 0.3) & (xy > 5).all(-1) & (xy < (WIDTH - 5, HEIGHT - 5)).all(-1)
    chosen = rng.permutation(len(X))[: num_points * 2 // 3]
    wanders = rng.random(len(X)) < outliers
    xy = xy + noise_px * rng.standard_normal(xy.shape)
    walk = np.cumsum(rng.normal(0, 3.0, (num_frames, len(X), 2)) + rng.normal(0, 2.0, (1, len(X), 2)), axis=0)
    xy = np.where(wanders[None, :, None], xy + walk, xy)
    frame, column = np.nonzero(visible[:, chosen])
    track = chosen[column]
    points = PointTracks(
        0, num_frames, track.astype(np.int32), frame.astype(np.int32), xy[frame, track].astype(np.float32),
        np.ones(len(frame), np.float32), window_px=22.5,
    )  # fmt: skip
    return Scene(points, Intrinsics(FOCAL, WIDTH, HEIGHT, "given", 0.0), R, t)
