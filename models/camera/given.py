"""The camera of one shot from cameras that the user gives."""

import numpy as np

from humanmm.models.geometry.intrinsics import K_of
from humanmm.models.geometry.rotations import interpolate_rotations
from humanmm.models.records.camera import Intrinsics, ShotCamera
from humanmm.models.records.shots import Shot

LEAST_FRACTION = 0.5
"""Of a shot's frames from the first given camera to the last one; with less the shot counts as not covered."""
STILL = 1e-9
"""A centre that moves by less stands still; files have 6 to 9 decimals."""


def given_camera(shot: Shot, intrinsics: Intrinsics) -> ShotCamera | None:
    """The camera of every frame of a shot, in the axes of its first one; None where the user gives none for this shot.

    Between given frames it is interpolated, before the first and after the last it stands still. The unit of the file
    is not trusted: the scale of a path is found with the people.
    """
    cameras = intrinsics.cameras
    if cameras is None:
        return None
    inside = (cameras.frame >= shot.start) & (cameras.frame < shot.end)
    known = cameras.frame[inside].astype(np.float64)
    num_frames = shot.end - shot.start
    if not len(known) or known[-1] - known[0] + 1 < LEAST_FRACTION * num_frames:
        return None
    at = np.arange(shot.start, shot.end, dtype=np.float64)
    R_given_cam = interpolate_rotations(at, known, cameras.R_given_cam[inside])
    t_given_cam = np.stack([np.interp(at, known, cameras.t_given_cam[inside, axis]) for axis in range(3)], axis=1)
    R_shot_given = R_given_cam[0].T
    t_shot_cam = (t_given_cam - t_given_cam[0]) @ R_shot_given.T
    travels = bool((np.abs(t_shot_cam) > STILL).any())
    K = np.tile(K_of(intrinsics), (num_frames, 1, 1))
    focal_px = cameras.focal_px[inside]
    if np.isfinite(focal_px).all() and np.isclose(np.nanmedian(cameras.focal_px), intrinsics.focal_px):
        K[:, [0, 1], [0, 1]] = np.interp(at, known, focal_px)[:, None]
    warnings: tuple[str, ...] = ()
    if len(known) < num_frames:
        warnings = (f"the given cameras are of {len(known)} of its {num_frames} frames: interpolated between them",)
    return ShotCamera(
        shot.start, shot.end, R_shot_given @ R_given_cam, t_shot_cam if travels else np.zeros((num_frames, 3)),
        K, "given", metric=not travels, reprojection_px=float("nan"), warnings=warnings,
    )  # fmt: skip
