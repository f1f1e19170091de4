"""Camera of one shot: standing, turning or moving, in this order (paper section 3.2, with the simple answers first).

A tripod and a pan are told apart from a moving camera because odometry on them is ill-posed: it would invent a
translation out of noise. Whatever had to be assumed for want of evidence is said in the result's warnings, with
`source="fallback"`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from humanmm.models.camera.cross_check import cross_check, warnings_of
from humanmm.models.camera.masking import background_points
from humanmm.models.camera.odometry.bundle import Freedom, Observations, Points, Views
from humanmm.models.camera.odometry.keyframe_odometry import (
    EXACT_SHARE,
    MIN_POINTS,
    MOVING_GAIN,
    Track,
    all_images,
    also_zooming,
    moving,
    rotating,
    zooms_in,
)
from humanmm.models.camera.odometry.tracked_shot import TrackedShot, arrange, choose_keyframes
from humanmm.models.camera.self_calibration import HINT_SHARE, with_own_focal
from humanmm.models.camera.static import judge_standing
from humanmm.models.geometry import rotations
from humanmm.models.records.camera import CameraSource, CrossCheck, Intrinsics, PointTracks, ShotCamera
from humanmm.models.records.tracks import PersonTrack

POOR_SHARE = 0.004
"""A fit worse than this share of the diagonal is no measurement any more."""
ZOOMING = Freedom(translation=False, zoom=True)
KNOWN_FOCAL = 0.1
"""A focal length with a relative uncertainty below this is known, for the purpose of telling zoom from travel."""


@dataclass(frozen=True)
class _Answer:
    source: CameraSource
    track: Track
    views: Views
    """Of every recorded image."""
    residual_px: Float[np.ndarray, " m"]
    warnings: tuple[str, ...]


def estimate_camera(
    points: PointTracks, people: Sequence[PersonTrack], intrinsics: Intrinsics, *, static: bool = False
) -> ShotCamera:
    """Camera of every frame of the shot that `points` were tracked in, people left out; `static` is the user's word."""
    num_frames = points.end - points.start
    if static:
        return _resting(points, intrinsics, "given")
    background = background_points(points, people)
    shot = arrange(background, intrinsics.width, intrinsics.height)
    seen = np.diff(shot.begins)
    if num_frames == 1:
        return _resting(points, intrinsics, "static")
    enough = shot.num_images >= 2 and float(np.quantile(seen, 0.1)) >= MIN_POINTS
    if not enough and (shot.num_images < 2 or float(np.median(seen)) < MIN_POINTS):
        found = int(np.median(seen)) if len(seen) else 0
        said = f"only {found} background points a frame (at least {MIN_POINTS} needed): the camera is taken as standing"
        return _resting(points, intrinsics, "fallback", said)
    warnings = () if enough else ("in some frames almost no background is in view: the camera is interpolated there",)
    standing = judge_standing(shot)
    if standing.static:
        return replace(_resting(points, intrinsics, "static"), warnings=warnings)
    answer = _turning_or_moving(shot, intrinsics)
    return _result(points, shot, intrinsics, replace(answer, warnings=warnings + answer.warnings))


def _resting(points: PointTracks, intrinsics: Intrinsics, source: CameraSource, *warnings: str) -> ShotCamera:
    num_frames = points.end - points.start
    return ShotCamera(
        points.start, points.end, np.tile(np.eye(3), (num_frames, 1, 1)), np.zeros((num_frames, 3)),
        np.tile(intrinsics.K, (num_frames, 1, 1)), source, metric=True, points_shot=np.zeros((0, 3)),
        reprojection_px=float("nan"), cross_check=CrossCheck(), warnings=warnings,
    )  # fmt: skip


def _turning_or_moving(shot: TrackedShot, intrinsics: Intrinsics) -> _Answer:
    """The simplest camera that explains the background: turning, turning and zooming, moving, moving and zooming.

    A zoom looks much like a step forward; only points at different distances tell them apart.
    """
    keyframes = choose_keyframes(shot)
    turning_only = Freedom(translation=False)
    turning = rotating(shot, keyframes, intrinsics.focal_px, freedom=turning_only)
    exact = EXACT_SHARE * shot.diagonal_px
    if turning.adjusted.noise_px < exact:
        return _answer(shot, turning, turning_only, "rotation_only")
    zooming = rotating(shot, keyframes, intrinsics.focal_px, freedom=ZOOMING)
    known = intrinsics.relative_uncertainty < KNOWN_FOCAL
    guide = turning
    zooms = zooms_in(zooming, turning)
    own = _with_own_focal(shot, zooming, intrinsics) if zooms else None
    if own is not None:
        zooming = own
        if not known:
            guide, known = rotating(shot, keyframes, own.views.focal_px, freedom=turning_only), True
    needs_no_travel = zooms and zooming.adjusted.noise_px < exact
    turned_error_px = zooming.error_px if zooms else turning.error_px
    moved = None if needs_no_travel else moving(shot, guide)
    if moved is not None and moved.error_px < MOVING_GAIN * turned_error_px:
        return _moving(shot, moved, focal_is_known=known)
    if not zooms:
        return _answer(shot, turning, turning_only, "rotation_only")
    if own is None:  # the video's focal length is the middle of the zoom
        first_px = intrinsics.focal_px * float(np.exp(-zooming.views.log_zoom.mean()))
        zooming = rotating(shot, keyframes, first_px, freedom=ZOOMING)
    said = f"the camera zooms: {_range(zooming)}"
    if moved is not None and moved.error_px < turned_error_px:
        said += "; a camera that travels would explain the points about as well"
    return _answer(shot, zooming, ZOOMING, "rotation_only", said)


def _with_own_focal(shot: TrackedShot, zooming: Track, intrinsics: Intrinsics) -> Track | None:
    """The track of a turning and zooming camera with its own focal length; None where the points do not tell it, or the
    user has."""
    if intrinsics.source == "given" or zooming.adjusted.noise_px > HINT_SHARE * shot.diagonal_px:
        return None
    own = with_own_focal(zooming, ZOOMING)
    return own.track if own.log_focal_sigma < KNOWN_FOCAL else None


def _moving(shot: TrackedShot, moved: Track, *, focal_is_known: bool) -> _Answer:
    """A moving camera; one that zooms as well only if the focal length is known.

    A wrong focal length bends the path of a moving camera much as a zoom does: what fits better then is no proof.
    """
    travel_only = Freedom(translation=True)
    if moved.error_px < EXACT_SHARE * shot.diagonal_px:
        return _answer(shot, moved, travel_only, "tracked")
    zooming = also_zooming(moved)
    if not zooms_in(zooming, moved):
        return _answer(shot, moved, travel_only, "tracked")
    if focal_is_known:
        said = f"the camera zooms as it travels: {_range(zooming)}"
        return _answer(shot, zooming, Freedom(translation=True, zoom=True), "tracked", said)
    said = (
        f"the points fit better ({zooming.error_px:.1f} instead of {moved.error_px:.1f} px) if the focal length "
        "changes within the shot, but as it is not known, travel alone is taken: give the focal length"
    )
    return _answer(shot, moved, travel_only, "tracked", said)


def _range(zooming: Track) -> str:
    """The focal lengths of a zoom, in words."""
    focals_px = zooming.views.focals_px
    percent = 100 * (focals_px.max() / focals_px.min() - 1)
    return f"its focal length changes by {percent:.0f} % ({focals_px.min():.0f} to {focals_px.max():.0f} px)"


def _answer(shot: TrackedShot, track: Track, freedom: Freedom, source: CameraSource, *warnings: str) -> _Answer:
    views, residual = all_images(shot, track, freedom=freedom)
    breaks = _breaks(shot, track)
    if breaks:
        said = ", ".join(str(frame) for frame in breaks[:5]) + (", …" if len(breaks) > 5 else "")
        warnings += (
            f"hardly any point survives frame {said}: the camera's motion there is assumed to go on as before",
        )
    error = float(np.median(residual)) if len(residual) else float("inf")
    if error > POOR_SHARE * shot.diagonal_px:
        source = "fallback"
        said = f"the background fits no camera well (median error {error:.1f} px): rotation is a rough estimate"
        warnings = (*warnings, said)
    return _Answer(source, track, views, residual, warnings)


def _breaks(shot: TrackedShot, track: Track) -> list[int]:
    """Frames of keyframes that share too few points with the keyframe before to carry a pose across."""
    pairs = pairwise(int(image) for image in track.keyframes)
    return [int(shot.frame[b]) for a, b in pairs if len(shot.shared(a, b)[0]) < MIN_POINTS]


def _result(points: PointTracks, shot: TrackedShot, intrinsics: Intrinsics, answer: _Answer) -> ShotCamera:
    moves = answer.source == "tracked"
    at, known_at = np.arange(points.start, points.end, dtype=float), shot.frame.astype(float)
    R_shot_cam = rotations.interpolate_rotations(at, known_at, answer.views.R_shot_cam)
    R_first = R_shot_cam[0].T
    t_shot_cam = np.zeros((len(at), 3))
    if moves:
        t_shot_cam = np.stack([np.interp(at, known_at, answer.views.t_shot_cam[:, axis]) for axis in range(3)], 1)
        t_shot_cam = (t_shot_cam - t_shot_cam[0]) @ R_first.T
    K = np.tile(intrinsics.K, (len(at), 1, 1))
    K[:, [0, 1], [0, 1]] = np.interp(at, known_at, answer.views.focals_px)[:, None]
    check = cross_check(shot, answer.track, translating=moves)
    return ShotCamera(
        points.start, points.end, R_first @ R_shot_cam, t_shot_cam, K, answer.source, metric=not moves,
        points_shot=_structure(answer.track) if moves else np.zeros((0, 3)),
        reprojection_px=float(np.median(answer.residual_px)), cross_check=check,
        warnings=answer.warnings + warnings_of(check),
    )  # fmt: skip


def _structure(track: Track) -> Float[np.ndarray, "p 3"]:
    """Points of the map whose distance is known from parallax of at least a degree."""
    observations: Observations = track.observations
    used = np.unique(observations.point[track.known[observations.point]])
    used = used[track.points.rho[used] > 0]
    baseline = np.zeros(len(track.known))
    ray = track.points.anchor[observations.point] - track.views.t_shot_cam[observations.image]
    across = np.linalg.norm(np.cross(track.points.direction[observations.point], ray), axis=1)
    np.maximum.at(baseline, observations.point, across)
    sure = baseline[used] * track.points.rho[used] > np.radians(1.0)
    chosen = used[sure]
    return Points(track.points.direction[chosen], track.points.rho[chosen], track.points.anchor[chosen]).positions()
