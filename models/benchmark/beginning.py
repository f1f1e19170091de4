"""The stages up to the motion of each shot, in memory: what the methods that are compared begin with.

The same pure functions run as in `humanmm.tasks`, in the same order; only what comes from pixels is given.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from humanmm.config import Config
from humanmm.models.camera.background.ground import GroundPicture
from humanmm.models.camera.background.keyframes import FrameFeatures
from humanmm.models.camera.focal_length.intrinsics import ShotPoints, intrinsics_of_shots
from humanmm.models.camera.shot_points import without_transitions
from humanmm.models.motion.fit.hmr import NoiseModel, fit_shot
from humanmm.models.motion.rotations.shot_results import ShotResults
from humanmm.models.records.camera import Intrinsics, PointTracks, ShotCamera
from humanmm.models.records.motion import ShotMotion
from humanmm.models.records.shots import Shot, ShotList
from humanmm.models.shot_detection.people_cuts import Parts
from humanmm.models.shots.assemble import detect_shots
from humanmm.models.synthetic.multishot import BenchVideo
from humanmm.parts import load

OfFrame = TypeVar("OfFrame", FrameFeatures, GroundPicture)


@dataclass(frozen=True)
class Beginning:
    """All stages up to the motion of each shot."""

    shots: ShotList
    intrinsics: Intrinsics
    cameras: tuple[ShotCamera, ...]
    motions: tuple[ShotMotion, ...]


def begin(video: BenchVideo, config: Config) -> Beginning:
    """Shots, focal length, cameras and per-shot motion, as the stages of these names compute them."""
    facts = video.facts
    parts: Parts = "scenes" if video.cuts_known else config.shots.parts
    shots = detect_shots(facts, video.scenes, video.people, only_person=config.shots.person, parts=parts)
    tracks = points_of_shots(video, shots)
    intrinsics = _focal_length(video, config, shots, tracks)
    static = config.camera.static or video.static_cameras
    estimator = load("camera.estimator", config.camera.estimator)
    cameras = tuple(
        estimator(points, video.people[shot.scene].tracks, intrinsics.of_shot(shot.start, shot.end), static=static)
        for shot, points in zip(shots.shots, tracks, strict=True)
    )
    motions = tuple(_fit(video, config, shots, shot, camera) for shot, camera in zip(shots.shots, cameras, strict=True))
    return Beginning(shots, intrinsics, cameras, motions)


def points_of_shots(video: BenchVideo, shots: ShotList) -> list[PointTracks]:
    """Tracked points of the clear frames of every shot."""
    return [without_transitions(video.points_of(shot.start, shot.end), shot.clear) for shot in shots.shots]


def without_swap_correction(video: BenchVideo, config: Config, start: Beginning) -> Beginning:
    """The same with left and right as the detector named them; only what differs is fitted again."""
    shots = replace(start.shots, shots=tuple(_as_labelled(shot) for shot in start.shots.shots))
    motions = tuple(
        motion if new == old else _fit(video, config, shots, new, camera)
        for new, old, camera, motion in zip(shots.shots, start.shots.shots, start.cameras, start.motions, strict=True)
    )
    return replace(start, shots=shots, motions=motions)


def fitted_again(video: BenchVideo, config: Config, start: Beginning) -> Beginning:
    """The same shots, every body fitted with other settings."""
    pairs = zip(start.shots.shots, start.cameras, strict=True)
    return replace(start, motions=tuple(_fit(video, config, start.shots, shot, camera) for shot, camera in pairs))


def _fit(video: BenchVideo, config: Config, shots: ShotList, shot: Shot, camera: ShotCamera) -> ShotMotion:
    noise = NoiseModel(prior=config.hmr.pose_prior, smoothness=config.hmr.smoothness)
    pose = load("hmr.initial_pose", config.hmr.initial_pose)
    scene, time_s = video.people[shot.scene], video.facts.time_s
    return fit_shot(scene, shot, shots.people, time_s, camera, noise=noise, initial_pose=pose)


def _focal_length(video: BenchVideo, config: Config, shots: ShotList, tracks: Sequence[PointTracks]) -> Intrinsics:
    settings, pairs = config.intrinsics, zip(shots.shots, tracks, strict=True)
    usable = (ShotPoints(points, video.people[shot.scene].tracks) for shot, points in pairs)
    key_frames = _by_shot(video.key_frames, shots)
    return intrinsics_of_shots(video.facts, usable, key_frames, focal_px=settings.focal_px, fov_deg=settings.fov_deg)


def _as_labelled(shot: Shot) -> Shot:
    return replace(shot, people=tuple(replace(appearance, left_right_swapped=()) for appearance in shot.people))


def shot_results_of(video: BenchVideo, start: Beginning) -> ShotResults:
    """What the stage `align` reads. Where there are no pictures there are no key frames either: shots are then joined
    by people alone, as in the paper."""
    return ShotResults(
        shots=start.shots,
        scenes=video.people,
        cameras=start.cameras,
        motions=start.motions,
        time_s=video.facts.time_s,
        intrinsics=start.intrinsics,
        key_frames=_by_shot(video.key_frames, start.shots),
        ground=_by_shot(video.ground, start.shots) if video.ground else (),
        pictures=_by_shot(video.pictures, start.shots) if video.pictures else (),
    )


def _by_shot(pictures: Sequence[OfFrame], shots: ShotList) -> list[list[OfFrame]]:
    return [[one for one in pictures if shot.start <= one.frame < shot.end] for shot in shots.shots]
