"""The camera of one shot from cameras that the user gives, held against the background that was seen to move."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from humanmm.models.camera.masking import background_points
from humanmm.models.camera.odometry.tracked_shot import TrackedShot, arrange, choose_keyframes
from humanmm.models.geometry.intrinsics import K_of
from humanmm.models.geometry.rotations import interpolate_rotations, skew
from humanmm.models.records.camera import Intrinsics, PointTracks, ShotCamera
from humanmm.models.records.shots import Shot
from humanmm.models.records.tracks import PersonTrack

Array = np.ndarray

LEAST_FRACTION = 0.5
"""Of a shot's frames from the first given camera to the last one; with less the shot counts as not covered."""
STILL = 1e-9
"""A centre that moves by less stands still; files have 6 to 9 decimals."""
FEWEST_POINTS = 20
"""Of the background in two key frames, for them to say how the camera moved between these."""
OFF_FRACTION, OFF_SHARE = 0.004, 0.3
"""The background lies beside where given cameras have it by more than this fraction of the picture's diagonal, and of
its own motion in the picture: they are of something else. A focal length that is wrong by a tenth shifts it by a tenth
of that motion."""
INVERSE_BETTER = 0.5
"""The inverse of the given cameras is named if it leaves less than this share of the error."""


def checked(
    given: ShotCamera, shot: Shot, intrinsics: Intrinsics, points: PointTracks, people: Sequence[PersonTrack]
) -> ShotCamera:
    """The same with how far beside the background's points lie, and a warning if that is too far.

    `points`: of this shot, on people too; `people`: tracks of its scene.
    """
    background = background_points(points, people)
    tracked = arrange(background, intrinsics.width, intrinsics.height, distortion=intrinsics.distortion)
    off_px, moved_px = _off_px(given, tracked)
    given = replace(given, reprojection_px=off_px)
    if not off_px > max(OFF_FRACTION * tracked.diagonal_px, OFF_SHARE * moved_px):
        return given
    inverse = given_camera(shot, _inverse(intrinsics))
    inverse_px = np.inf if inverse is None else _off_px(inverse, tracked)[0]
    said = f"the background lies {off_px:.0f} px beside where the given cameras have it in the next key frame"
    if inverse_px < INVERSE_BETTER * off_px:
        said += f", their inverse {inverse_px:.1f} px: they seem to be world to camera; camera to world is expected"
    else:
        said += f", of {moved_px:.0f} px that it moves: are they of this video, and of these frames?"
    return replace(given, warnings=(*given.warnings, said))


def _inverse(intrinsics: Intrinsics) -> Intrinsics:
    """With the given cameras as if they had been written the other way round."""
    cameras = intrinsics.cameras
    if cameras is None:
        return intrinsics
    R = np.swapaxes(cameras.R_given_cam, -1, -2)
    t = -np.einsum("nab,nb->na", R, cameras.t_given_cam)
    return replace(intrinsics, cameras=replace(cameras, R_given_cam=R, t_given_cam=t))


def _off_px(camera: ShotCamera, tracked: TrackedShot) -> tuple[float, float]:
    """How far from one key frame to the next points lie beside where a camera has them, and how far they move; medians
    of points, then of key frames, pixels. NaN where too few points are seen."""
    found = []
    for a, b in pairwise(choose_keyframes(tracked).tolist()):
        _, xy_a, xy_b = tracked.shared(a, b)
        if len(xy_a) >= FEWEST_POINTS:
            moved = float(np.median(np.linalg.norm(xy_b - xy_a, axis=1)))
            row_a, row_b = (int(tracked.frame[image]) - camera.start for image in (a, b))
            found.append((_pair_off_px(camera, row_a, row_b, xy_a, xy_b), moved))
    off_px, moved_px = np.median(found, axis=0) if found else (np.nan, np.nan)
    return float(off_px), float(moved_px)


def _pair_off_px(camera: ShotCamera, a: int, b: int, xy_a: Float[Array, "n 2"], xy_b: Float[Array, "n 2"]) -> float:
    """Median distance of points from where they are if all are far away, or from their epipolar lines (Sampson's;
    Hartley and Zisserman, equation 11.9) if that is less: where a path is short, its direction says nothing.

    Pixels from the middle of the picture.
    """
    focal_a, focal_b = camera.K[a, 0, 0], camera.K[b, 0, 0]
    ray_a, ray_b = (np.column_stack([xy, np.full(len(xy), f)]) / f for xy, f in ((xy_a, focal_a), (xy_b, focal_b)))
    R_b_a = camera.R_shot_cam[b].T @ camera.R_shot_cam[a]
    turned = ray_a @ R_b_a.T
    ahead = turned[:, 2] > 0
    far = focal_b * turned[ahead, :2] / turned[ahead, 2:] - xy_b[ahead]
    off = [float(np.median(np.linalg.norm(far, axis=1)))] if ahead.any() else []
    t_b_a = camera.R_shot_cam[b].T @ (camera.t_shot_cam[a] - camera.t_shot_cam[b])
    if np.linalg.norm(t_b_a) > STILL:
        E = skew(t_b_a / np.linalg.norm(t_b_a)) @ R_b_a
        line_b, line_a = ray_a @ E.T / focal_b, ray_b @ E / focal_a
        slope = np.sqrt((line_a[:, :2] ** 2).sum(axis=1) + (line_b[:, :2] ** 2).sum(axis=1))
        off.append(float(np.median(np.abs((ray_b * (ray_a @ E.T)).sum(axis=1)) / np.maximum(slope, STILL))))
    return min(off, default=np.inf)


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
