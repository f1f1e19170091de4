"""One walker in two shots, as the solve of the world is given him."""

import numpy as np

from humanmm.models.geometry.rotations import unit
from humanmm.models.motion.world.problem import CameraEdge, ShotRig, ShotTrajectory

FPS = 30.0
EDGE = CameraEdge(0, 1, 8.0)


def stride(num_frames: int) -> tuple[np.ndarray, np.ndarray]:
    """Pelvis (n,3) and sole points from it (n,4,3) of somebody who walks along x, one foot standing at any time."""
    time_s = np.arange(num_frames) / FPS
    pelvis = np.stack([1.2 * time_s, 0.03 * np.sin(2 * np.pi * time_s), 0.95 + 0 * time_s], axis=1)
    feet = np.zeros((num_frames, 4, 3))
    for side, phase in ((0, 0.0), (2, 0.5)):
        cycle = time_s + phase
        step, part = np.floor(cycle), cycle % 1.0
        along = 1.2 * (step + np.clip((part - 0.5) * 2, 0, 1) - phase) + 0.3
        lift = 0.12 * np.sin(np.pi * np.clip((part - 0.5) * 2, 0, 1))
        for toe in (0, 1):
            feet[:, side + toe] = np.stack([along + 0.2 * toe, 0.1 * (1 - side) + 0 * along, lift], axis=1)
    return pelvis, feet - pelvis[:, None]


def scene(
    *, scale: float = 1.0, noise: float = 0.0, cut: int = 30, num_frames: int = 60
) -> tuple[list[ShotTrajectory], list[ShotRig], np.ndarray]:
    """One walker in two shots: a moving camera of unknown scale, then a static one; and the true pelvis."""
    rng = np.random.default_rng(0)
    pelvis, feet = stride(num_frames)
    frames = np.arange(num_frames, dtype=np.int32)
    path = np.stack([0.02 * frames, -4.0 + 0.01 * frames, 1.4 + 0 * frames], axis=1)[:cut]
    centre = np.array([2.0, 4.0, 1.2])
    trajectories, rigs = [], []
    for shot, (rows, camera) in enumerate(
        ((frames[:cut], path), (frames[cut:], np.tile(centre, (num_frames - cut, 1))))
    ):
        offset = pelvis[rows] - camera
        # Depth errs slowly, as a fit's does.
        offset = offset * (1 + noise * np.sin(rows / 9.0 + shot))[:, None] + rng.normal(0, 0.2 * noise, offset.shape)
        trajectories.append(
            ShotTrajectory(0, shot, rows, rows / FPS, offset, feet[rows], np.ones(len(rows)), unit(offset))
        )
        rigs.append(ShotRig((camera - camera[0]) / scale, int(rows[0]), 1.0, scale_known=shot == 1))
    return trajectories, rigs, pelvis
