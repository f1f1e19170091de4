"""One focal length for all shots (the paper's assumption): given, estimated from the background, or a prior.

The prior. `geometry.intrinsics` says where its centre comes from; one standard deviation spans 25 to 55 mm full-frame
equivalent.

The evidence. Every shot whose camera rotates or moves gives its focal length with an uncertainty (`self_calibration`),
and so do straight edges of walls and floors wherever they are seen, also by a static camera (`walls_focal`). Prior and
evidence are multiplied on a grid of ln(focal); evidence has heavy tails, so that a shot with a lens of its own, or one
that was misread, does not drag the rest away.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from humanmm.models.camera.background.keyframes import FrameFeatures, KeyFrameFeatures
from humanmm.models.camera.background.walls_focal import LOG_SCALES, focal_log_likelihood
from humanmm.models.camera.masking import background_points
from humanmm.models.camera.model_choice import HINT_FRACTION, ModelChoice, choose_model, settled_model
from humanmm.models.camera.odometry.keyframe_odometry import EXACT_FRACTION, MIN_POINTS
from humanmm.models.camera.odometry.tracked_shot import TrackedShot, arrange
from humanmm.models.camera.self_calibration import FocalTrack
from humanmm.models.camera.shot_points import points_of_shot
from humanmm.models.geometry.intrinsics import default_focal_px
from humanmm.models.records.camera import ChosenModel, EdgeEvidence, GivenCameras, Intrinsics, PointTracks
from humanmm.models.records.shots import ShotList
from humanmm.models.records.tracks import PersonTrack, ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.models.video.progress import Progress, parts_of, silent

DEFAULT_RELATIVE_SIGMA = 0.4
MODEL_RELATIVE_SIGMA = 0.03
"""What a pinhole with its principal point in the middle is worth on a real lens; no estimate claims to be better."""
TAIL_DEGREES = 3.0
"""Degrees of freedom of Student's t for the evidence of a shot."""
MAX_FRAMES = 600
"""Recorded frames of a shot that are looked at."""
MAX_SHOTS = 4
"""Shots whose points are used, those with most points over most frames first."""
MAX_PICTURES = 6
"""Shots whose straight edges are used, those with the longest first."""
LEAST_RELATIVE_SIGMA = 0.02
"""No result claims to be surer, since all evidence shares the model's error; once it is that sure, no further shot is
used."""
NARROWED = 0.5
"""The result is called estimated if its standard deviation is below this fraction of the prior's."""


@dataclass(frozen=True)
class ShotPoints:
    """One shot's tracked points and the people to be left out of them."""

    points: PointTracks
    people: Sequence[PersonTrack]


def given_intrinsics(width: int, height: int, *, focal_px: float | None, fov_deg: float | None) -> Intrinsics | None:
    """The user's own focal length, in pixels or as a horizontal field of view in degrees; None if neither is given."""
    if focal_px is None and fov_deg is None:
        return None
    focal = focal_px if focal_px is not None else width / 2 / math.tan(math.radians(fov_deg or 0.0) / 2)
    return Intrinsics(focal, width, height, "given", 0.0)


def estimate_intrinsics(
    facts: VideoFacts,
    shots: ShotList,
    people: Sequence[ScenePeople | None],
    points: Sequence[PointTracks | None],
    key_frames: KeyFrameFeatures,
    *,
    focal_px: float | None = None,
    fov_deg: float | None = None,
    cameras: GivenCameras | None = None,
    progress: Progress = silent,
) -> Intrinsics:
    """One focal length for all shots: the user's (`focal_px` in pixels, or the horizontal `fov_deg` in degrees), or
    that of the given cameras, or the background's estimate, or the default.

    `people` and `points`: one a scene, None where it failed. `cameras` are passed on to the shots.
    """
    usable = (
        ShotPoints(points_of_shot(tracks, shot), scene.tracks)
        for shot in shots.shots
        if (tracks := points[shot.scene]) is not None and (scene := people[shot.scene]) is not None
    )
    return intrinsics_of_shots(
        facts, usable, key_frames.of_shot, filmed=shots.filmed_size(facts.width, facts.height), focal_px=focal_px,
        fov_deg=fov_deg, cameras=cameras, progress=progress,
    )  # fmt: skip


def intrinsics_of_shots(
    facts: VideoFacts,
    shots: Iterable[ShotPoints],
    key_frames: Sequence[Sequence[FrameFeatures]],
    *,
    filmed: tuple[float, float] | None = None,
    focal_px: float | None = None,
    fov_deg: float | None = None,
    cameras: GivenCameras | None = None,
    progress: Progress = silent,
) -> Intrinsics:
    """The same from the points of each shot, which are asked for only where nothing is given; `key_frames`: of each
    shot; `filmed`: width and height without the bars beside the film, of which the prior is."""
    given = given_intrinsics(facts.width, facts.height, focal_px=focal_px, fov_deg=fov_deg)
    if given is None and cameras is not None and np.isfinite(cameras.focal_px).any():
        given = Intrinsics(float(np.nanmedian(cameras.focal_px)), facts.width, facts.height, "given", 0.0)
    if given is not None:
        return replace(given, cameras=cameras)
    (by_shots,) = parts_of(progress, facts.num_frames, (1,))
    pictures = middle_frames(key_frames)
    found = intrinsics_from_background(
        list(shots), facts.width, facts.height, pictures, filmed=filmed, progress=by_shots
    )
    return replace(found, cameras=cameras)


def middle_frames(of_shot: Sequence[Sequence[FrameFeatures]]) -> list[FrameFeatures]:
    """One key frame of each shot; of those with the longest straight edges."""
    middle = [frames[len(frames) // 2] for frames in of_shot if frames]
    length = [float(np.linalg.norm(f.segments[:, 2:] - f.segments[:, :2], axis=1).sum()) for f in middle]
    return [middle[k] for k in np.argsort(-np.array(length), kind="stable")[:MAX_PICTURES]]


def intrinsics_from_background(
    shots: Sequence[ShotPoints],
    width: int,
    height: int,
    pictures: Sequence[FrameFeatures] = (),
    *,
    filmed: tuple[float, float] | None = None,
    progress: Progress = silent,
) -> Intrinsics:
    """The focal length that prior and background agree on; source "default" where the background says too little.

    `pictures`: key frames whose straight edges are used; `filmed`: as in `intrinsics_of_shots`.
    """
    default = default_focal_px(*(filmed or (width, height)))
    log_focal = math.log(default) + LOG_SCALES
    edges = tuple(
        EdgeEvidence(picture.frame, log_focal, likelihood)
        for picture in pictures
        if (likelihood := focal_log_likelihood(picture.segments, default, width, height)) is not None
    )
    evidence: list[FocalEvidence | EdgeEvidence] = list(edges)
    result = combine(evidence, default, width, height)
    chosen: list[tuple[TrackedShot, ModelChoice]] = []
    longest = sorted(shots, key=lambda shot: -len(shot.points.frame))[:MAX_SHOTS]
    for done, shot in enumerate(longest):
        progress(done, len(longest))
        beginning = _beginning(shot.points)
        background = arrange(background_points(beginning, shot.people), width, height)
        if background.num_images >= 3 and float(np.median(np.diff(background.begins))) >= MIN_POINTS:
            choice = choose_model(background, result, calibrate=True)
            if beginning is shot.points:
                chosen.append((background, choice))
            found = focal_evidence(background, choice)
            if found is not None:
                evidence.append(found)
                result = combine(evidence, default, width, height)
        if result.relative_uncertainty <= LEAST_RELATIVE_SIGMA:
            break
    models = tuple(
        ChosenModel(shot.start, shot.end, model)
        for shot, choice in chosen
        if (model := settled_model(choice, shot, result)) is not None
    )
    return replace(result, models=models, edges=edges)


def _beginning(points: PointTracks) -> PointTracks:
    """The first recorded frames of a long shot."""
    frames = np.unique(points.frame)
    if len(frames) <= MAX_FRAMES:
        return points
    last = int(np.searchsorted(points.frame, frames[MAX_FRAMES]))
    return replace(
        points, track=points.track[:last], frame=points.frame[:last], xy=points.xy[:last],
        confidence=points.confidence[:last],
    )  # fmt: skip


@dataclass(frozen=True)
class FocalEvidence:
    """What one shot says about the focal length."""

    focal_px: float
    log_sigma: float
    """Standard deviation of ln(focal)."""

    def log_likelihood(self, log_focal: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Up to a constant, at ln(focal)."""
        sigma = math.hypot(self.log_sigma, MODEL_RELATIVE_SIGMA)
        scaled = (log_focal - math.log(self.focal_px)) / sigma
        return np.asarray(-0.5 * (TAIL_DEGREES + 1) * np.log1p(scaled**2 / TAIL_DEGREES))


def focal_evidence(shot: TrackedShot, choice: ModelChoice) -> FocalEvidence | None:
    """Focal length of a shot from its model; None where the camera is static or fits badly.

    Of a shot that zooms the answer is the middle of its range, as uncertain as the zoom is large; if it moves as well,
    that of a camera which only rotates and zooms. What fits roughly counts as less certain: a rotation in proportion, a
    path by the square, whose points may be rigid with a wrong focal length as well.
    """
    if choice.rotating is None:
        return None
    if choice.model == "moving" and choice.moving is not None and math.isfinite(choice.moving.log_focal_sigma):
        return _evidence(choice.moving, _misfit(shot, choice.moving) ** 2)
    if choice.zooming is not None and math.isfinite(choice.zooming.log_focal_sigma):
        return _evidence(choice.zooming)
    misfit = _misfit(shot, choice.rotating)
    return _evidence(choice.rotating, misfit) if misfit < HINT_FRACTION / EXACT_FRACTION else None


def _misfit(shot: TrackedShot, calibrated: FocalTrack) -> float:
    """How many times as far as it should a track's points lie from where it puts them; 1 where it fits."""
    return max(1.0, calibrated.track.adjusted.noise_px / (EXACT_FRACTION * shot.diagonal_px))


def _evidence(calibrated: FocalTrack, factor: float = 1.0) -> FocalEvidence:
    """The middle of a track's focal lengths, `factor` times as uncertain as its points say."""
    views = calibrated.track.views
    middle_px = views.focal_px * float(np.exp(views.log_zoom.mean()))
    return FocalEvidence(middle_px, factor * float(np.hypot(calibrated.log_focal_sigma, np.ptp(views.log_zoom))))


def combine(evidence: Sequence[FocalEvidence | EdgeEvidence], default_px: float, width: int, height: int) -> Intrinsics:
    """Mean and spread of prior times evidence over ln(focal)."""
    log_focal = math.log(default_px) + np.linspace(-2.0, 2.0, 8001)
    log_density = -0.5 * ((log_focal - math.log(default_px)) / DEFAULT_RELATIVE_SIGMA) ** 2
    for one in evidence:
        log_density = log_density + one.log_likelihood(log_focal)
    density = np.exp(log_density - log_density.max())
    density /= density.sum()
    mean = float((density * log_focal).sum())
    sigma = max(float(np.sqrt((density * (log_focal - mean) ** 2).sum())), LEAST_RELATIVE_SIGMA)
    narrowed = sigma < NARROWED * DEFAULT_RELATIVE_SIGMA
    if not narrowed:
        warning = (
            f"the focal length is assumed ({default_px:.0f} px, known to {DEFAULT_RELATIVE_SIGMA:.0%}): neither the "
            "camera's motion nor straight edges give it, and distances are as uncertain; give --focal-px or --fov-deg"
        )
        return Intrinsics(default_px, width, height, "default", DEFAULT_RELATIVE_SIGMA, (warning,))
    return Intrinsics(math.exp(mean), width, height, "estimated", sigma)
