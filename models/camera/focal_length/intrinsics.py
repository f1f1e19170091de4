"""The focal length that the shots of a video share (the paper's assumption): given, estimated from the background, or a
prior; those of shots that clearly have a lens of their own (`lenses`); and how the lens bends straight lines
(`distortion`).

The prior. `geometry.intrinsics` says where its centre comes from; one standard deviation spans 25 to 55 mm full-frame
equivalent.

The evidence. Every shot whose camera rotates or moves gives its focal length with an uncertainty (`self_calibration`),
and so do straight edges of walls and floors wherever they are seen, also by a static camera (`walls_focal`). Prior and
evidence are multiplied on a grid of ln(focal); evidence has heavy tails, so that a shot that was misread does not drag
the rest away.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from humanmm.errors import ConfigError
from humanmm.models.camera.background.enlarged import enlargement
from humanmm.models.camera.background.keyframes import FrameFeatures, KeyFrameFeatures
from humanmm.models.camera.background.walls_focal import LOG_SCALES, focal_log_likelihood
from humanmm.models.camera.focal_length.distortion import (
    CLEAR,
    LEAST,
    MOST,
    DistortionEvidence,
    distortion_evidence,
    together,
)
from humanmm.models.camera.focal_length.evidence import (
    DEFAULT_RELATIVE_SIGMA,
    Evidence,
    FocalEvidence,
    Weighed,
    focal_evidence,
    log_likelihood,
)
from humanmm.models.camera.focal_length.lenses import groups_of, with_own_lens
from humanmm.models.camera.masking import background_points
from humanmm.models.camera.model_choice import ModelChoice, choose_model, settled_model
from humanmm.models.camera.odometry.keyframe_odometry import MIN_POINTS
from humanmm.models.camera.odometry.tracked_shot import TrackedShot, arrange
from humanmm.models.camera.shot_points import points_of_shot
from humanmm.models.geometry.intrinsics import default_focal_px
from humanmm.models.records.camera import (
    ChosenModel,
    EdgeEvidence,
    GivenCameras,
    Intrinsics,
    OwnLens,
    PointTracks,
    is_doubtful_focal,
)
from humanmm.models.records.shots import ShotList
from humanmm.models.records.tracks import PersonTrack, ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.models.video.progress import Progress, parts_of, silent

MAX_FRAMES = 600
"""Recorded frames of a shot that are looked at."""
MAX_SHOTS = 4
"""Shots whose points are used, those with most points over most frames first."""
MAX_PICTURES = 6
"""Shots whose straight edges are used, those with the longest first."""
LEAST_RELATIVE_SIGMA = 0.02
"""No result claims to be surer, since all evidence shares the model's error."""
DISTORTION_ROUNDS, SETTLED = 3, 0.003
"""So often everything is looked at again with the distortion that was found, until it changes by less than this."""
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
    if focal_px is not None and fov_deg is not None:
        raise ConfigError("focal_px and fov_deg exclude each other")
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
    found = intrinsics_from_background(
        list(shots), facts.width, facts.height, key_frames, filmed=filmed, progress=by_shots
    )
    return replace(found, cameras=cameras)


def intrinsics_from_background(
    shots: Sequence[ShotPoints],
    width: int,
    height: int,
    key_frames: Sequence[Sequence[FrameFeatures]] = (),
    *,
    filmed: tuple[float, float] | None = None,
    progress: Progress = silent,
) -> Intrinsics:
    """The focal length that prior and background agree on, source "default" where the background says too little, those
    of shots that have a lens of their own, and the distortion of the lens.

    `key_frames` and `filmed`: as in `intrinsics_of_shots`.
    """
    video = _Seen.of(shots, key_frames, default_focal_px(*(filmed or (width, height))), width, height)
    pinhole = found = _of_lens(video, 0.0, progress=progress)
    left, std = together(pinhole.left)
    if left + CLEAR * std > 0:
        return pinhole.intrinsics
    distortion = 0.0
    for _ in range(DISTORTION_ROUNDS):
        distortion = max(distortion + left, MOST)
        found = _of_lens(video, distortion)
        left, std = together(found.left)
        if abs(left) < SETTLED:
            break
    if distortion > LEAST:
        return pinhole.intrinsics
    corner_px = -distortion * math.hypot(width, height) / 2
    warning = (
        f"the lens bends straight lines (barrel distortion {distortion:.3f} ± {std:.3f}: {corner_px:.0f} px at the "
        "corners): cameras allow for it, people are placed as if it did not (docs/wrong.md: how to straighten a video)"
    )
    result = found.intrinsics
    return replace(result, warnings=(*result.warnings, warning))


@dataclass(frozen=True)
class _OfLens:
    """What the background says of a lens whose distortion is taken for known."""

    intrinsics: Intrinsics
    left: Sequence[DistortionEvidence]
    """Of the shots' points, once it is taken out of them."""


def _of_lens(video: "_Seen", distortion: float, *, progress: Progress = silent) -> _OfLens:
    """The focal lengths of all shots if the video's lens has this distortion."""
    default, width, height = video.default_px, video.width, video.height
    edges = _edges_of(video, distortion)
    evidence: list[list[Evidence]] = [
        [one for one in edges if shot.start <= one.frame < shot.end] for shot in video.shots
    ]
    chosen: list[tuple[TrackedShot, ModelChoice]] = []
    from_points: list[tuple[int, FocalEvidence | None, DistortionEvidence | None]] = []
    for done, (k, points, whole) in enumerate(video.tracked):
        progress(done, len(video.tracked))
        background = arrange(points, width, height, distortion=distortion)
        if background.num_images < 3 or float(np.median(np.diff(background.begins))) < MIN_POINTS:
            continue
        known = [found for _, found, _ in from_points if found is not None]
        guess = combine([*(one for of_shot in evidence for one in of_shot), *known], default, width, height)
        choice = choose_model(background, guess, calibrate=True)
        if whole:
            chosen.append((background, choice))
        from_points.append((k, focal_evidence(background, choice), distortion_evidence(background, choice)))
    left = [bent for _, _, bent in from_points if bent is not None]
    _, std = together(left)
    for k, found, bent in from_points:
        if found is not None:
            of_lens = bent.log_focal_std(std) if bent is not None else 0.0
            evidence[k].append(replace(found, log_sigma=math.hypot(found.log_sigma, of_lens)))
    result = _with_lenses(video, evidence, distortion)
    models = tuple(
        ChosenModel(shot.start, shot.end, model)
        for shot, choice in chosen
        if (model := settled_model(choice, shot, result.of_shot(shot.start, shot.end))) is not None
    )
    return _OfLens(replace(result, models=models, edges=edges), left)


@dataclass(frozen=True)
class _SeenShot:
    """What is seen of the background of the shot [start, end)."""

    start: int
    end: int
    points: ShotPoints | None
    key_frames: Sequence[FrameFeatures]


@dataclass(frozen=True)
class _Seen:
    """What is seen of the background of a video, whatever its lens."""

    shots: Sequence[_SeenShot]
    tracked: Sequence[tuple[int, PointTracks, bool]]
    """Of the shots with most points their number, the points on nobody in their beginning, and whether that is all."""
    enlarged: Mapping[int, float]
    """By shot, how many times as long as that of the shot before its focal length is."""
    default_px: float
    width: int
    height: int

    @classmethod
    def of(
        cls,
        shots: Sequence[ShotPoints],
        key_frames: Sequence[Sequence[FrameFeatures]],
        default_px: float,
        width: int,
        height: int,
    ) -> "_Seen":
        seen, tracked = _seen_shots(shots, key_frames), []
        with_points = [(k, shot.points) for k, shot in enumerate(seen) if shot.points is not None]
        for k, shot in sorted(with_points, key=lambda shot: -len(shot[1].points.frame))[:MAX_SHOTS]:
            beginning = _beginning(shot.points)
            tracked.append((k, background_points(beginning, shot.people), beginning is shot.points))
        enlarged = {
            k: ratio
            for k in range(1, len(seen))
            if (ratio := enlargement(seen[k - 1].key_frames, seen[k].key_frames, max(width, height))) is not None
        }
        return cls(seen, tracked, enlarged, default_px, width, height)


def _seen_shots(shots: Sequence[ShotPoints], key_frames: Sequence[Sequence[FrameFeatures]]) -> list[_SeenShot]:
    """In order of time; a shot without points reaches from its first to its last key frame."""
    seen = [_SeenShot(shot.points.start, shot.points.end, shot, ()) for shot in shots]
    for frames in key_frames:
        if not frames:
            continue
        first = frames[0].frame
        k = next((k for k, shot in enumerate(seen) if shot.start <= first < shot.end), None)
        if k is None:
            seen.append(_SeenShot(first, frames[-1].frame + 1, None, frames))
        else:
            seen[k] = replace(seen[k], key_frames=frames)
    return sorted(seen, key=lambda shot: shot.start)


def _edges_of(video: _Seen, distortion: float) -> tuple[EdgeEvidence, ...]:
    """What straight edges say in the middle key frames of the shots that show the longest."""
    default, width, height = video.default_px, video.width, video.height
    middle = [
        shot.key_frames[len(shot.key_frames) // 2].straightened(distortion, width, height)
        for shot in video.shots
        if shot.key_frames
    ]
    length = [float(np.linalg.norm(f.segments[:, 2:] - f.segments[:, :2], axis=1).sum()) for f in middle]
    log_focal = math.log(default) + LOG_SCALES
    return tuple(
        EdgeEvidence(middle[k].frame, log_focal, likelihood)
        for k in np.argsort(-np.array(length), kind="stable")[:MAX_PICTURES]
        if (likelihood := focal_log_likelihood(middle[k].segments, default, width, height)) is not None
    )


def _with_lenses(video: _Seen, evidence: Sequence[Sequence[Evidence]], distortion: float) -> Intrinsics:
    """The focal length that most shots share, and the lenses of those that do not."""
    seen, default, width, height = video.shots, video.default_px, video.width, video.height
    groups = groups_of(evidence, video.enlarged, [shot.end - shot.start for shot in seen])
    own = with_own_lens(groups, default)
    shared = combine([one for group in groups if group not in own for one in group.evidence], default, width, height)
    lenses, warnings = [], list(shared.warnings)
    for group in groups:
        lens = _estimated(group.evidence, default, width, height) if group in own else shared
        for k, ratio in group.ratios.items():
            if group not in own and ratio == 1:
                continue
            one = OwnLens(
                seen[k].start, seen[k].end, ratio * lens.focal_px, lens.source, lens.relative_uncertainty,
                distortion / ratio**2,
            )  # fmt: skip
            lenses.append(one)
            if group in own and is_doubtful_focal(one.source, one.relative_uncertainty):
                warnings.append(
                    f"frames {one.start} to {one.end - 1} seem to be seen with a lens of their own, whose focal length "
                    f"is uncertain ({one.focal_px:.0f} px, known to {one.relative_uncertainty:.0%})"
                )
    return replace(shared, lenses=tuple(lenses), warnings=tuple(warnings), distortion=distortion)


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


def combine(evidence: Sequence[Evidence], default_px: float, width: int, height: int) -> Intrinsics:
    """Mean and spread of prior times evidence over ln(focal); the default where that is hardly narrower."""
    found = _estimated(evidence, default_px, width, height)
    if found.relative_uncertainty < NARROWED * DEFAULT_RELATIVE_SIGMA:
        return found
    warning = (
        f"the focal length is assumed ({default_px:.0f} px, known to {DEFAULT_RELATIVE_SIGMA:.0%}): neither the "
        "camera's motion nor straight edges give it, and distances are as uncertain; give --focal-px or --fov-deg"
    )
    return Intrinsics(default_px, width, height, "default", DEFAULT_RELATIVE_SIGMA, (warning,))


def _estimated(evidence: Sequence[Evidence], default_px: float, width: int, height: int) -> Intrinsics:
    mean, std = Weighed(log_likelihood(evidence, default_px)).log_ratio
    return Intrinsics(default_px * math.exp(mean), width, height, "estimated", max(std, LEAST_RELATIVE_SIGMA))
