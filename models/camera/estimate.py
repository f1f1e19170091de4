"""Camera of one shot: of the model that was chosen for it, in every frame (paper section 3.2).

Whatever had to be assumed for want of evidence is said in the result's warnings, with `source="fallback"`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from humanmm.models.camera.cross_check import cross_check, warnings_of
from humanmm.models.camera.masking import background_points
from humanmm.models.camera.model_choice import (
    MOVING,
    MOVING_ZOOMING,
    ROTATING,
    ZOOMING,
    ModelChoice,
    choose_model,
    first_focal_px,
    track_model,
)
from humanmm.models.camera.odometry.bundle import Freedom, Views
from humanmm.models.camera.odometry.keyframe_odometry import (
    MIN_POINTS,
    Track,
    all_images,
    rotating,
)
from humanmm.models.camera.odometry.scenery import scenery_of
from humanmm.models.camera.odometry.tracked_shot import TrackedShot, arrange
from humanmm.models.geometry import rotations
from humanmm.models.geometry.intrinsics import K_of
from humanmm.models.records.camera import CameraSource, CrossCheck, Intrinsics, PointTracks, ShotCamera
from humanmm.models.records.tracks import PersonTrack
from humanmm.models.video.progress import Progress, parts_of, silent

POOR_FRACTION = 0.004
"""A fit worse than this fraction of the diagonal is no measurement any more."""
ALIKE = 2.5
"""A camera that zooms where it stands explains points nearly as well as one that travels if their residuals are no more
than so many times as large; from 1 / MOVING_GAIN down it is preferred."""
CLEAR_POINTS = 4 * MIN_POINTS
"""Where so many points are seen before and after, and fewer than MIN_POINTS are the same, all were lost at once."""


CARRIED_ON_S, SPEED_OVER_S = 0.4, 0.2
"""Seconds for which a camera is taken to move on as it did over so many seconds."""


@dataclass(frozen=True)
class _Estimate:
    source: CameraSource
    travels: bool
    """Whether its path is measured, whatever the source."""
    track: Track
    views: Views
    """Of every recorded image."""
    residual_px: Float[np.ndarray, " m"]
    warnings: tuple[str, ...]


def camera_from_points(
    points: PointTracks,
    people: Sequence[PersonTrack],
    intrinsics: Intrinsics,
    *,
    static: bool = False,
    progress: Progress = silent,
) -> ShotCamera:
    """Camera of every frame of the shot that `points` were tracked in, from those that lie on nobody (a
    `CameraEstimator`); `static`: the user says that the camera is static."""
    num_frames = points.end - points.start
    if static:
        return _static(points, intrinsics, "given")
    masking, odometry = parts_of(progress, num_frames, (1, 3))
    background = background_points(points, people, progress=masking)
    shot = arrange(background, intrinsics.width, intrinsics.height, distortion=intrinsics.distortion)
    seen = np.diff(shot.begins)
    if num_frames == 1:
        return _static(points, intrinsics, "static")
    enough = shot.num_images >= 2 and float(np.quantile(seen, 0.1)) >= MIN_POINTS
    if not enough and (shot.num_images < 2 or float(np.median(seen)) < MIN_POINTS):
        found = int(np.median(seen)) if len(seen) else 0
        said = f"only {found} background points a frame (at least {MIN_POINTS} needed): the camera is taken as static"
        return _static(points, intrinsics, "fallback", said)
    warnings = () if enough else ("in some frames almost no background is in view: the camera is interpolated there",)
    settled = intrinsics.model_of(points.start, points.end)
    tracked = None if settled is None else track_model(shot, intrinsics, settled, progress=odometry)
    choice = choose_model(shot, intrinsics, progress=odometry) if tracked is None else tracked
    if choice.rotating is None:
        return _standing(points, shot, intrinsics, warnings)
    estimate = _chosen(shot, choice, choice.rotating.track, intrinsics)
    return _result(points, shot, intrinsics, replace(estimate, warnings=warnings + estimate.warnings))


def _static(points: PointTracks, intrinsics: Intrinsics, source: CameraSource, *warnings: str) -> ShotCamera:
    num_frames = points.end - points.start
    return ShotCamera(
        points.start, points.end, np.tile(np.eye(3), (num_frames, 1, 1)), np.zeros((num_frames, 3)),
        np.tile(K_of(intrinsics), (num_frames, 1, 1)), source, metric=True,
        reprojection_px=float("nan"), cross_check=CrossCheck(), warnings=warnings,
    )  # fmt: skip


def _standing(points: PointTracks, shot: TrackedShot, intrinsics: Intrinsics, warnings: tuple[str, ...]) -> ShotCamera:
    """A static camera; whether it also stood where nearly all points were lost at once, nobody knows."""
    seen = np.diff(shot.begins)
    clear = [b for b in range(1, shot.num_images) if seen[b - 1 : b + 1].min() >= CLEAR_POINTS]
    breaks = [int(shot.frame[b]) for b in clear if len(shot.shared(b - 1, b)[0]) < MIN_POINTS]
    if not breaks:
        return _static(points, intrinsics, "static", *warnings)
    said = f"hardly any point survives frame {_listed(breaks)}: the camera is taken to stand there, too"
    return _static(points, intrinsics, "fallback", *warnings, said)


def _chosen(shot: TrackedShot, choice: ModelChoice, rotating_track: Track, intrinsics: Intrinsics) -> _Estimate:
    """The camera of the chosen model; `rotating_track` is the track of the camera that only rotates."""
    if choice.model == "moving" and choice.moving is not None:
        return _moving(shot, choice, choice.moving.track, intrinsics)
    if choice.zooming is None:
        return _estimate(shot, rotating_track, ROTATING, "rotation_only")
    zooming = choice.zooming.track
    if not np.isfinite(choice.zooming.log_focal_sigma) and intrinsics.source != "given":
        first_px, _ = first_focal_px(zooming, shot, intrinsics)
        zooming = rotating(shot, zooming.keyframes, first_px, freedom=ZOOMING)
    said = f"the camera zooms: {_range(zooming, _known(shot, choice, intrinsics))}"
    if choice.moving is not None and choice.moving.track.error_px < choice.zooming.track.error_px:
        said += "; a camera that travels would explain the points about as well"
    return _estimate(shot, zooming, ZOOMING, "rotation_only", said)


def _moving(shot: TrackedShot, choice: ModelChoice, moved: Track, intrinsics: Intrinsics) -> _Estimate:
    """A moving camera, perhaps one that zooms as well."""
    if not np.ptp(moved.views.log_zoom):
        zooming = choice.zooming.track if choice.zooming is not None else None
        if zooming is None or zooming.error_px > ALIKE * moved.error_px:
            return _estimate(shot, moved, MOVING, "tracked")
        off = f"{zooming.error_px:.1f} px off instead of {moved.error_px:.1f}"
        said = f"the camera travels, or zooms where it stands: that would explain the points nearly as well ({off})"
        return _estimate(shot, moved, MOVING, "tracked", said)
    said = f"the camera zooms as it travels: {_range(moved, _known(shot, choice, intrinsics))}"
    return _estimate(shot, moved, MOVING_ZOOMING, "tracked", said)


def _known(shot: TrackedShot, choice: ModelChoice, intrinsics: Intrinsics) -> str:
    """How well it is known where a zoom lies, in words: a given focal length is taken as that of the first frame."""
    if intrinsics.source == "given":
        return "if the given one is that of its first frame"
    if choice.zooming is None:
        log_sigma = intrinsics.relative_uncertainty
    elif np.isfinite(choice.zooming.log_focal_sigma):
        log_sigma = choice.zooming.log_focal_sigma
    else:
        log_sigma = first_focal_px(choice.zooming.track, shot, intrinsics)[1]
    return f"both known to {100 * max(log_sigma, 0.01):.0f} %"


def _range(zooming: Track, known: str) -> str:
    """The focal lengths of a zoom, in words."""
    least, most = zooming.views.focals_px.min(), zooming.views.focals_px.max()
    return f"its focal length changes by {100 * (most / least - 1):.0f} % ({least:.0f} to {most:.0f} px, {known})"


def _estimate(shot: TrackedShot, track: Track, freedom: Freedom, source: CameraSource, *warnings: str) -> _Estimate:
    views, residual = all_images(shot, track, freedom=freedom)
    travels = source == "tracked"
    breaks = _breaks(shot, track)
    if breaks:
        source = "fallback"
        warnings += (
            f"hardly any point survives frame {_listed(breaks)}: how the camera moved there is not known, and all "
            "after it is a guess",
        )
    error = float(np.median(residual)) if len(residual) else float("inf")
    if error > POOR_FRACTION * shot.diagonal_px:
        source, travels = "fallback", False
        said = f"the background fits no camera well (median error {error:.1f} px): rotation is a rough estimate"
        warnings = (*warnings, said)
    return _Estimate(source, travels, track, views, residual, warnings)


def _breaks(shot: TrackedShot, track: Track) -> list[int]:
    """Frames of keyframes that share too few points with the keyframe before to carry a pose across."""
    pairs = pairwise(int(image) for image in track.keyframes)
    return [int(shot.frame[b]) for a, b in pairs if len(shot.shared(a, b)[0]) < MIN_POINTS]


def _listed(frames: list[int]) -> str:
    """The first few, in words."""
    return ", ".join(str(frame) for frame in frames[:5]) + (", …" if len(frames) > 5 else "")


def _carried_on(
    shot: TrackedShot, views: Views, points: PointTracks
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n 3 3"], Float[np.ndarray, "n 3"]]:
    """Frames, rotations and centres of the recorded images, and one more where they begin after the first frame of
    `points` or end before the last: in the dark part of a fade, and where two pictures mix, a camera goes on as it
    moved, for a while."""
    longest, speed_over = (max(1, round(seconds * points.rate_hz)) for seconds in (CARRIED_ON_S, SPEED_OVER_S))
    frames, R, t = shot.frame.astype(float), views.R_shot_cam, views.t_shot_cam
    for end, limit in ((0, points.start), (-1, points.end - 1)):
        missing = float(np.clip(limit - frames[end], -longest, longest))
        other = int(np.abs(np.abs(frames - frames[end]) - speed_over).argmin())
        if not missing or frames[other] == frames[end]:
            continue
        times = missing / (frames[end] - frames[other])
        turned = rotations.rotmat_to_rotvec(R[other].T @ R[end])
        R_new = R[end] @ rotations.rotvec_to_rotmat(times * turned)
        at = 0 if end == 0 else len(frames)
        t = np.insert(t, at, t[end] + times * (t[end] - t[other]), axis=0)
        frames, R = np.insert(frames, at, frames[end] + missing), np.insert(R, at, R_new, axis=0)
    return frames, R, t


def _result(points: PointTracks, shot: TrackedShot, intrinsics: Intrinsics, estimate: _Estimate) -> ShotCamera:
    at = np.arange(points.start, points.end, dtype=float)
    known_at, R_map_cam, t_known = _carried_on(shot, estimate.views, points)
    R_shot_cam = rotations.interpolate_rotations(at, known_at, R_map_cam)
    R_first = R_shot_cam[0].T
    t_shot_cam, scenery = np.zeros((len(at), 3)), None
    if estimate.travels:
        t_map_cam = np.stack([np.interp(at, known_at, t_known[:, axis]) for axis in range(3)], 1)
        t_shot_cam = (t_map_cam - t_map_cam[0]) @ R_first.T
        scenery = scenery_of(estimate.track, t_map_cam[0], R_first)
    K = np.tile(K_of(intrinsics), (len(at), 1, 1))
    K[:, [0, 1], [0, 1]] = np.interp(at, shot.frame.astype(float), estimate.views.focals_px)[:, None]
    check = cross_check(shot, estimate.track, translating=estimate.travels)
    return ShotCamera(
        points.start, points.end, R_first @ R_shot_cam, t_shot_cam, K, estimate.source, metric=not estimate.travels,
        reprojection_px=float(np.median(estimate.residual_px)), cross_check=check,
        warnings=estimate.warnings + warnings_of(check), scenery=scenery,
    )  # fmt: skip
