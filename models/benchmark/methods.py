"""The methods that are compared: the pipeline's own stages in memory, with one left out, replaced or given the truth.

The same pure functions run as in `humanmm.tasks`, in the same order; only what comes from pixels is given. Methods
share the stages that they have in common.
"""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from humanmm.config import Config
from humanmm.errors import HumanMMError
from humanmm.models.benchmark.oracles import true_cameras, true_rotations, with_true_cuts, yaw_rotations
from humanmm.models.camera.background.ground import GroundPicture
from humanmm.models.camera.background.keyframes import FrameFeatures
from humanmm.models.camera.intrinsics import ShotPoints, intrinsics_of_shots
from humanmm.models.camera.masking import without_transitions
from humanmm.models.cuts.camera_rotation import align_by_eight_point
from humanmm.models.motion.fit.hmr import NoiseModel, fit_shot
from humanmm.models.motion.refine.refine import RefineSettings, refine
from humanmm.models.motion.world.align import ShotResults, align
from humanmm.models.motion.world.witnesses import WITNESSES
from humanmm.models.records.camera import Intrinsics, PointTracks, ShotCamera
from humanmm.models.records.motion import PersonMotion, ShotMotion, WorldMotion
from humanmm.models.records.shots import Shot, ShotList
from humanmm.models.shots.assemble import detect_shots
from humanmm.models.shots.people_cuts import Parts
from humanmm.models.synthetic.multishot import BenchVideo
from humanmm.parts import load

OfFrame = TypeVar("OfFrame", FrameFeatures, GroundPicture)

Array = np.ndarray

METHODS: tuple[str, ...] = (
    "humanmm",
    "concat",
    "humanmm with eight-point",
    "humanmm without swap correction",
    "humanmm without refine",
    "oracle cuts",
    "oracle yaw",
    "oracle camera rotation",
    "oracle camera",
)
"""The oracles take from the truth: the cuts; at every cut the camera's rotation about the vertical, or the whole of it;
the whole camera, that is its path inside shots, its focal length and its rotations at cuts. All else is estimated."""
ABLATIONS: tuple[str, ...] = (
    "humanmm",
    "humanmm with eight-point",
    "humanmm without orientation alignment",
    "humanmm without swap correction",
    "humanmm without background links",
    "humanmm without pose prior",
    "humanmm without discontinuity removal",
    "humanmm without trajectory networks",
    "humanmm with ms-HMR",
    "humanmm without refit",
    "humanmm without foot lock",
    "humanmm without refine",
    "concat",
)
"""Each module off, one at a time. Without orientation alignment the worlds of the baseline are refined as ours are;
without background links only people connect shots; walls, positions, shadows and floors still speak for rotations."""
_WITNESS_LEFT_OUT = {
    "humanmm without people at cuts": "people",
    "humanmm without positions": "positions",
    "humanmm without background links": "background",
    "humanmm without walls": "walls",
    "humanmm without shadows": "shadows",
    "humanmm without floors": "floors",
}
"""Evidence that is not used where the rotations at cuts are decided (`align.WITNESSES`)."""
CUTS: tuple[str, ...] = ("humanmm", *_WITNESS_LEFT_OUT, "humanmm with eight-point", "oracle camera rotation")
"""How the shots are joined: each witness left out in turn, the paper's essential matrix, the true rotations."""
CAMERAS: tuple[str, ...] = (
    "humanmm",
    "humanmm without masks",
    "humanmm with static cameras",
    "oracle camera",
)
"""Where the camera inside a shot comes from: our odometry on the background; the same on all points, people's too;
every camera taken for a static one; the truth."""
_REFINED_OTHERWISE: Mapping[str, Mapping[str, bool | str]] = {
    "humanmm without discontinuity removal": {"remove_discontinuities": False},
    "humanmm without trajectory networks": {"networks": "none"},
    "humanmm with ms-HMR": {"networks": "all"},
    "humanmm without refit": {"refit": False},
    "humanmm without foot lock": {"foot_lock": False},
}
"""Settings of `refine` that a method has of its own."""


@dataclass(frozen=True)
class MethodMotion:
    """What one method made of one video."""

    method: str
    motion: WorldMotion | None
    """None where it failed."""
    shots: ShotList | None
    reason: str = ""
    """Why it failed."""


@dataclass(frozen=True)
class VideoMotions:
    """What all methods made of one video."""

    motions: tuple[MethodMotion, ...]


@dataclass(frozen=True)
class Beginning:
    """All stages up to the motion of each shot."""

    shots: ShotList
    intrinsics: Intrinsics
    cameras: tuple[ShotCamera, ...]
    motions: tuple[ShotMotion, ...]


def run_methods(video: BenchVideo, config: Config, methods: Sequence[str] = METHODS) -> VideoMotions:
    """Every method on one video. An error, expected or not, is a failure of the methods that it hits."""
    try:
        start = begin(video, config)
    except Exception as error:  # the edge of the stages, as in the flow
        return VideoMotions(tuple(MethodMotion(method, None, None, _in_words(error)) for method in methods))
    stages = _SharedStages(video, config, start)
    return VideoMotions(tuple(_attempt(method, stages) for method in methods))


class _SharedStages:
    """What the methods share of one video; each part is computed when it is first used."""

    def __init__(self, video: BenchVideo, config: Config, start: Beginning) -> None:
        self.video = video
        self.config = config
        self.start = start

    @functools.cached_property
    def as_labelled(self) -> Beginning:
        """The beginning without the correction of left-right swaps."""
        return without_swap_correction(self.video, self.config, self.start)

    @functools.cached_property
    def without_prior(self) -> Beginning:
        """The beginning with every pose as likely as any other."""
        hmr = self.config.hmr.model_copy(update={"pose_prior": 0.0})
        return fitted_again(self.video, self.config.model_copy(update={"hmr": hmr}), self.start)

    @functools.cached_property
    def without_masks(self) -> Beginning:
        """The beginning with cameras from all points, people's too."""
        return self._with_cameras_of_all_points(static=self.config.camera.static or self.video.static_cameras)

    @functools.cached_property
    def with_static_cameras(self) -> Beginning:
        """The beginning with static cameras."""
        return self._with_cameras_of_all_points(static=True)

    def _with_cameras_of_all_points(self, *, static: bool) -> Beginning:
        start = self.start
        tracks = points_of_shots(self.video, start.shots)
        estimator = load("camera.estimator", self.config.camera.estimator)
        cameras = tuple(estimator(points, (), start.intrinsics, static=static) for points in tracks)
        return fitted_again(self.video, self.config, replace(start, cameras=cameras))

    @functools.cached_property
    def with_true_cameras(self) -> Beginning:
        """The beginning with the true cameras."""
        cameras = true_cameras(self.video, self.start.shots)
        known = float(cameras[0].K[0, 0, 0])
        focal = replace(self.start.intrinsics, focal_px=known, source="given", relative_uncertainty=0.0)
        return fitted_again(self.video, self.config, replace(self.start, cameras=cameras, intrinsics=focal))

    @functools.cached_property
    def cut_truly(self) -> "_SharedStages":
        """Everything again on the true cuts; the same where no other were found."""
        of_shots = [shot.transition for shot in self.start.shots.shots[1:]]
        found = [[(t.start, t.end) for t in part if t] for part in (of_shots, self.video.scenes.transitions)]
        if found == [list(self.video.truth.transitions)] * 2:
            return self
        video = with_true_cuts(self.video)
        return _SharedStages(video, self.config, begin(video, self.config))

    @functools.cached_property
    def world(self) -> WorldMotion:
        """What `align` makes of it."""
        return align(shot_results_of(self.video, self.start), method=load("align.method", self.config.align.method))

    @functools.cached_property
    def refined(self) -> WorldMotion:
        """What `refine` makes of that: the pipeline's own result."""
        return self.refine(self.start, self.world)

    def refine(self, start: Beginning, world: WorldMotion, **otherwise: bool | str) -> WorldMotion:
        """The stage `refine` with the user's settings, some of them `otherwise`; nobody corrects the floor here."""
        return refine(
            world,
            start.shots,
            self.video.people,
            time_s=self.video.facts.time_s,
            settings=RefineSettings.chosen(self.config.refine.model_copy(update=otherwise)),
        )


def _attempt(method: str, stages: _SharedStages) -> MethodMotion:
    try:
        return MethodMotion(method, _recovered(method, stages), _start_of(method, stages).shots)
    except Exception as error:  # one method's crash must not take the others with it
        return MethodMotion(method, None, None, _in_words(error))


def _start_of(method: str, stages: _SharedStages) -> Beginning:
    """What a method's world was made of."""
    if method == "humanmm without swap correction":
        return stages.as_labelled
    if method == "oracle cuts":
        return stages.cut_truly.start
    return stages.start


def _in_words(error: Exception) -> str:
    return str(error) if isinstance(error, HumanMMError) else f"unexpected {type(error).__name__}: {error}"


_OTHER_BEGINNINGS: Mapping[str, Callable[[_SharedStages], Beginning]] = {
    "humanmm without pose prior": lambda stages: stages.without_prior,
    "humanmm without masks": lambda stages: stages.without_masks,
    "humanmm with static cameras": lambda stages: stages.with_static_cameras,
}
"""Methods that differ before `align`."""


def _recovered(method: str, stages: _SharedStages) -> WorldMotion:  # noqa: PLR0911, PLR0912 (one case a method)
    how = load("align.method", stages.config.align.method)
    results = shot_results_of(stages.video, stages.start)
    if method == "humanmm":
        return stages.refined
    if method == "humanmm without refine":
        return stages.world
    if method in _REFINED_OTHERWISE:
        return stages.refine(stages.start, stages.world, **_REFINED_OTHERWISE[method])
    if method == "concat":
        return concatenated(results)
    if method == "humanmm without orientation alignment":
        return stages.refine(stages.start, concatenated(results))
    if method == "humanmm with eight-point":
        return stages.refine(stages.start, align(results, method=align_by_eight_point))
    if method in _WITNESS_LEFT_OUT:
        witness = _WITNESS_LEFT_OUT[method]
        pictures = {
            "background": results.key_frames,
            "walls": results.key_frames,
            "shadows": results.ground,
            "floors": results.pictures,
        }
        if witness in pictures and not any(pictures[witness]):
            return stages.refined
        return stages.refine(stages.start, align(results, method=how, witnesses=WITNESSES - {witness}))
    if method in _OTHER_BEGINNINGS:
        start = _OTHER_BEGINNINGS[method](stages)
        return stages.refine(start, align(shot_results_of(stages.video, start), method=how))
    if method == "humanmm without swap correction":
        if not _any_left_right_swap(stages.start.shots):
            return stages.refined
        return stages.refine(stages.as_labelled, align(shot_results_of(stages.video, stages.as_labelled), method=how))
    if method == "oracle cuts":
        return stages.cut_truly.refined
    if method == "oracle yaw":
        rotations = yaw_rotations(stages.video, stages.start.shots, stages.world)
        return stages.refine(stages.start, align(results, method=how, known_rotations=rotations))
    if method == "oracle camera rotation":
        rotations = true_rotations(stages.video, stages.start.shots)
        return stages.refine(stages.start, align(results, method=how, known_rotations=rotations))
    if method == "oracle camera":
        start, rotations = stages.with_true_cameras, true_rotations(stages.video, stages.start.shots)
        return stages.refine(start, align(shot_results_of(stages.video, start), method=how, known_rotations=rotations))
    raise ValueError(f"no method is called {method!r}")


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
        estimator(points, video.people[shot.scene].tracks, intrinsics, static=static)
        for shot, points in zip(shots.shots, tracks, strict=True)
    )
    motions = tuple(_fit(video, config, shots, shot, camera) for shot, camera in zip(shots.shots, cameras, strict=True))
    return Beginning(shots, intrinsics, cameras, motions)


def points_of_shots(video: BenchVideo, shots: ShotList) -> list[PointTracks]:
    """Tracked points of every shot outside gradual transitions."""
    return [
        without_transitions(video.points_of(shot.start, shot.end), shot.outside_transitions) for shot in shots.shots
    ]


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


def _any_left_right_swap(shots: ShotList) -> bool:
    return any(appearance.left_right_swapped for shot in shots.shots for appearance in shot.people)


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


def concatenated(results: ShotResults) -> WorldMotion:
    """The paper's baseline: each shot in its own gravity world, headed by that shot's first camera; these worlds are
    taken for one without any rotation, and the root is shifted so that it goes on where the shot before ended."""
    alone = align(_strangers(results))
    num_people = max((person.person for person in results.shots.people), default=0) + 1
    parts: dict[int, list[PersonMotion]] = {}
    for motion in sorted(alone.people, key=lambda motion: int(motion.frame[0])):
        parts.setdefault(motion.person % num_people, []).append(motion)
    t_world_cam = alone.t_world_cam.copy()
    people = []
    for number, motions in sorted(parts.items()):
        joined = motions[0]
        for motion in motions[1:]:
            shift = joined.pelvis_world[-1] - motion.pelvis_world[0]
            if number == 0:
                shot = next(s for s in results.shots.shots if s.start <= motion.frame[0] < s.end)
                t_world_cam[shot.start : shot.end] += shift
            joined = _appended(joined, replace(motion, pelvis_world=motion.pelvis_world + shift))
        people.append(replace(joined, person=number))
    return replace(alone, people=tuple(people), t_world_cam=t_world_cam)


def _strangers(results: ShotResults) -> ShotResults:
    """The same results, with nobody known to be in more than one shot: every shot then gets a world of its own."""
    num_people = max((person.person for person in results.shots.people), default=0) + 1
    shots, motions = [], []
    for index, (shot, motion) in enumerate(zip(results.shots.shots, results.motions, strict=True)):
        first = index * num_people
        shots.append(replace(shot, people=tuple(replace(a, person=first + a.person) for a in shot.people)))
        people = motion.people if motion is not None else ()
        renamed = tuple(replace(person, person=first + person.person) for person in people)
        motions.append(replace(motion, people=renamed) if motion is not None else None)
    return replace(results, shots=replace(results.shots, shots=tuple(shots)), motions=motions)


def _appended(first: PersonMotion, second: PersonMotion) -> PersonMotion:
    """One motion after the other; frames between them keep the last posture and are not observed."""
    gap = int(second.frame[0] - first.frame[-1]) - 1

    def held(before: Array, after: Array) -> Array:
        return np.concatenate([before, np.repeat(before[-1:], gap, axis=0), after])

    return PersonMotion(
        person=first.person,
        frame=np.arange(first.frame[0], second.frame[-1] + 1, dtype=np.int32),
        observed=np.concatenate([first.observed, np.zeros(gap, bool), second.observed]),
        R_world_root=held(first.R_world_root, second.R_world_root),
        body_pose=held(first.body_pose, second.body_pose),
        betas=first.betas,
        pelvis_world=held(first.pelvis_world, second.pelvis_world),
        contacts=held(first.contacts, second.contacts),
        confidence=held(first.confidence, second.confidence),
    )
