"""Which camera took a shot: the simplest that explains its background (paper section 3.2, with the simple answers
first).

In this order: static, rotation only, rotation and zoom, moving. Odometry on a tripod or a pan is ill-posed: it would
make a translation out of noise. A zoom looks much like a step forward; only points at different distances distinguish
them.

The model of a shot is chosen once. `intrinsics` chooses for the shots that it needs, each with a focal length of its
own (`calibrate`). Its choice is settled (`settled_model`) unless the video's focal length came out different, the shot
is longer than the part that was used, or it zooms: for those shots, and the ones that were not needed, `camera`
chooses, with the focal length of the video.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int

from humanmm.models.camera.odometry.bundle import Freedom
from humanmm.models.camera.odometry.keyframe_odometry import (
    EXACT_FRACTION,
    Track,
    moving,
    moving_and_zooming,
    rotating,
)
from humanmm.models.camera.odometry.tracked_shot import TrackedShot, choose_keyframes
from humanmm.models.camera.self_calibration import FocalTrack, with_own_focal
from humanmm.models.camera.static import is_static
from humanmm.models.records.camera import CameraModel, Intrinsics
from humanmm.models.video.progress import Progress, silent

MOVING_GAIN = 0.6
"""A moving camera must bring the residuals below this fraction of the rotating camera's: it has one more unknown per
point."""
ZOOM_GAIN = 0.75
"""The same for a zooming camera against one that does not zoom."""
MIN_ZOOM = 0.03
"""Changes of focal length below this fraction are not called a zoom."""
MIN_MOVING_ZOOM, MIN_ZOOM_POINTS = 0.08, 30
"""The least change of a moving camera's focal length that is a zoom, and the fewest lasting points that show one. In
rendered clips 19 of 20 zooms had 0.16 to 0.53, 25 of 27 constant lenses 0.06 and less: of the others one had larger
residuals, one 17 points."""
BETTER, AS_GOOD, FLAT = 0.9, 1.1, 0.4
"""A zoom is believed if its residuals are below this fraction of a constant lens'; or if they are as good, and the
constant lens makes a wall of the background: travel towards a plane looks like a zoom, and in rendered clips those
whose inverse depths spread by less than this fraction were zooms (0.10 to 0.37; true travel has 0.31 to 12)."""
HINT_FRACTION = 0.0015
"""A rotating camera that fits within this fraction of the diagonal gives a good first focal length for a moving one."""
KNOWN_FOCAL = 0.1
"""A focal length with a relative uncertainty below this is known, for the purpose of telling zoom from travel."""
MAX_KEYFRAMES = 24
"""Keyframes of a shot that are used to calibrate it: more would cost time and add little."""
ZOOM_SPREAD = 0.25
"""Of the logarithm of the focal length in the middle of a zoom about the video's."""
MAX_ROUNDS = 2
SAME_FOCAL = 0.05
"""A moving camera is tracked anew if its focal length came out further from the first guess than this."""

ROTATING, ZOOMING = Freedom(translation=False), Freedom(translation=False, zoom=True)
MOVING, MOVING_ZOOMING = Freedom(translation=True), Freedom(translation=True, zoom=True)


@dataclass(frozen=True)
class ModelChoice:
    """The model chosen, and the tracks of the models that were tried for it."""

    model: CameraModel
    rotating: FocalTrack | None = None
    """None of a static camera."""
    zooming: FocalTrack | None = None
    """None unless a zoom explains the shot clearly better than a rotation alone, or the camera zooms as it moves."""
    moving: FocalTrack | None = None
    """Also where it does not explain the shot well enough to be chosen; with a zoom if it zooms as it moves."""


def settled_model(choice: ModelChoice, shot: TrackedShot, intrinsics: Intrinsics) -> CameraModel | None:
    """The model of a shot that was chosen with a focal length of its own, if the video's focal length cannot change it.

    None where the two focal lengths differ, where only the beginning of the shot was looked at, and where it zooms or a
    zoom explains it better than a rotation alone.
    """
    track = choice.moving if choice.model == "moving" else choice.rotating
    if track is None or track.track.keyframes[-1] != shot.num_images - 1:
        return None
    if choice.zooming is not None:
        return None
    same = abs(np.log(track.track.views.focal_px / intrinsics.focal_px)) < SAME_FOCAL
    return choice.model if same else None


def track_model(
    shot: TrackedShot, intrinsics: Intrinsics, model: CameraModel, *, progress: Progress = silent
) -> ModelChoice | None:
    """The tracks of a settled model with the video's focal length; None where the odometry of a moving camera fails."""
    keyframes = choose_keyframes(shot)
    only_rotating = rotating(shot, keyframes, intrinsics.focal_px, freedom=ROTATING)
    if model == "rotation only":
        return ModelChoice(model, _kept(only_rotating))
    track = moving(shot, only_rotating, progress=progress)
    return None if track is None else ModelChoice(model, _kept(only_rotating), None, _kept(track))


def choose_model(
    shot: TrackedShot, intrinsics: Intrinsics, *, calibrate: bool = False, progress: Progress = silent
) -> ModelChoice:
    """The simplest camera that explains the background of a shot.

    `intrinsics` holds the focal length to assume; with `calibrate` every model gets the focal length that fits its
    points best, from the first keyframes only. Of a track that keeps the assumed focal length `log_focal_sigma` is
    infinite.
    """
    if is_static(shot):
        return ModelChoice("static")
    keyframes = choose_keyframes(shot)[: MAX_KEYFRAMES if calibrate else None]
    exact_px, hint_px = EXACT_FRACTION * shot.diagonal_px, HINT_FRACTION * shot.diagonal_px
    focal_px, known = intrinsics.focal_px, intrinsics.relative_uncertainty < KNOWN_FOCAL

    only_rotating = _followed(rotating(shot, keyframes, focal_px, freedom=ROTATING), ROTATING, calibrate=calibrate)
    if only_rotating.track.adjusted.noise_px < exact_px:
        return ModelChoice("rotation only", only_rotating)
    if calibrate and only_rotating.track.adjusted.noise_px < hint_px:
        focal_px = only_rotating.track.views.focal_px

    zooming = _kept(rotating(shot, keyframes, focal_px, freedom=ZOOMING))
    zooms = zooms_in(zooming.track, only_rotating.track)
    if zooms and intrinsics.source != "given" and zooming.track.adjusted.noise_px < hint_px:
        own = with_own_focal(zooming.track, ZOOMING)
        if calibrate or own.log_focal_sigma < KNOWN_FOCAL:
            zooming = own
            if calibrate or not known:
                focal_px = own.track.views.focal_px
    best = zooming if zooms else only_rotating
    found = zooming if zooms else None

    moved: FocalTrack | None = None
    if not (zooms and best.track.adjusted.noise_px < exact_px):
        if calibrate:
            moved = _moving_calibrated(shot, keyframes, focal_px, best.track.error_px)
        else:
            same = focal_px == only_rotating.track.views.focal_px
            guide = only_rotating.track if same else rotating(shot, keyframes, focal_px, freedom=ROTATING)
            track = moving(shot, guide, progress=progress)
            moved = None if track is None else _kept(track)
    if moved is None or moved.track.error_px >= MOVING_GAIN * best.track.error_px:
        return ModelChoice("rotation and zoom" if zooms else "rotation only", only_rotating, found, moved)
    views = zooming.track.views
    if np.ptp(views.log_zoom) > MIN_ZOOM and (zooms or moved.track.error_px > exact_px):
        first_px = views.focal_px
        if not np.isfinite(zooming.log_focal_sigma) and intrinsics.source != "given":
            first_px, _ = first_focal_px(zooming.track, shot, intrinsics)
        both = moving_and_zooming(shot, keyframes, first_px, views.log_zoom, max_starts=1)
        if both is not None and zooms_as_it_moves(both, moved.track):
            return ModelChoice("moving", only_rotating, zooming, _kept(both))
    return ModelChoice("moving", only_rotating, found, moved)


def zooms_in(zooming: Track, constant: Track) -> bool:
    """Whether a change of focal length explains the shot clearly better than the same camera with a constant one."""
    return float(np.ptp(zooming.views.log_zoom)) > MIN_ZOOM and zooming.error_px < ZOOM_GAIN * constant.error_px


def zooms_as_it_moves(zooming: Track, moved: Track) -> bool:
    """Whether a moving camera also zooms: `zooming` from `moving_and_zooming`, `moved` with a constant lens.

    A camera that moves along its axis may have zoomed instead, whatever it sees: without other evidence it did not.
    """
    if np.ptp(zooming.views.log_zoom) <= MIN_MOVING_ZOOM or np.count_nonzero(zooming.lasting) < MIN_ZOOM_POINTS:
        return False
    better_by = zooming.error_px / max(moved.error_px, 1e-9)
    return better_by < BETTER or (better_by < AS_GOOD and _depth_spread(moved) < FLAT)


def _depth_spread(track: Track) -> float:
    """How much the inverse depths of lasting points differ: from 10th to 90th percentile, over the median."""
    points = track.points
    rho = np.maximum(points.rho, 1e-6)[:, None]
    depth = (points.anchor + points.direction / rho)[track.lasting, 2]
    inverse = 1 / depth[depth > 0]
    if not len(inverse):
        return float("inf")
    low, middle, high = np.percentile(inverse, [10, 50, 90])
    return float((high - low) / middle)


def first_focal_px(zooming: Track, shot: TrackedShot, intrinsics: Intrinsics) -> tuple[float, float]:
    """Focal length in the first keyframe of a shot that zooms, where its points do not determine it, and the standard
    deviation of its logarithm.

    The focal length of the video is somewhere in the range of the zoom, most likely in its middle (ZOOM_SPREAD);
    straight edges in one of the shot's frames tell more.
    """
    frames, log_zoom = shot.frame[zooming.keyframes], zooming.views.log_zoom
    off = np.linspace(-3, 3, 121) * ZOOM_SPREAD
    log_first = np.log(intrinsics.focal_px) - log_zoom.mean() + off
    log_posterior = -0.5 * (off / ZOOM_SPREAD) ** 2
    seen = [edges for edges in intrinsics.edges if frames[0] <= edges.frame <= frames[-1]]
    for edges in seen:
        log_posterior += edges.log_likelihood(log_first + np.interp(edges.frame, frames, log_zoom))
    weight = np.exp(log_posterior - log_posterior.max())
    weight /= weight.sum()
    mean = float((weight * log_first).sum())
    sigma = float(np.sqrt((weight * (log_first - mean) ** 2).sum()))
    return float(np.exp(mean)), sigma if seen else float(np.hypot(sigma, intrinsics.relative_uncertainty))


def _moving_calibrated(
    shot: TrackedShot, keyframes: Int[np.ndarray, " k"], focal_px: float, rotated_error_px: float
) -> FocalTrack | None:
    """A moving camera's track with its own focal length; None where it explains the points no better than rotation."""
    found: FocalTrack | None = None
    for _ in range(MAX_ROUNDS):
        track = moving(shot, rotating(shot, keyframes, focal_px, freedom=ROTATING), max_starts=1)
        if track is None:
            break
        own = with_own_focal(track, MOVING)
        if not own.track.error_px < MOVING_GAIN * rotated_error_px:
            break
        found = own
        own_px = own.track.views.focal_px
        if abs(np.log(own_px / focal_px)) < SAME_FOCAL:
            break
        focal_px = own_px
    return found


def _kept(track: Track) -> FocalTrack:
    """A track that keeps the focal length that was assumed."""
    return FocalTrack(track, float("inf"))


def _followed(track: Track, freedom: Freedom, *, calibrate: bool) -> FocalTrack:
    return with_own_focal(track, freedom) if calibrate else _kept(track)
