"""The methods that are compared: the pipeline's own stages in memory, with one left out, replaced or given the truth.

The same pure functions run as in `humanmm.tasks`, in the same order; only what comes from pixels is given. Methods
share the stages that they have in common.
"""

import functools
from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass, replace

from jaxtyping import Float
from numpy import ndarray

from humanmm.config import Config
from humanmm.errors import HumanMMError
from humanmm.models.benchmark.beginning import (
    Beginning,
    begin,
    fitted_again,
    points_of_shots,
    shot_results_of,
    without_swap_correction,
)
from humanmm.models.benchmark.concatenation import concatenated
from humanmm.models.benchmark.oracles import true_cameras, true_rotations, with_true_cuts, yaw_rotations
from humanmm.models.cuts.camera_rotation import align_by_eight_point
from humanmm.models.motion.refine.refine import RefineSettings, refine
from humanmm.models.motion.world.align import align
from humanmm.models.motion.world.witnesses import WITNESSES
from humanmm.models.records.motion import WorldMotion
from humanmm.models.records.shots import ShotList
from humanmm.models.synthetic.multishot import BenchVideo
from humanmm.parts import load

KnownRotations = Mapping[int, Float[ndarray, "3 3"]]
"""See `align`."""

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
        return self.align(self.start)

    @functools.cached_property
    def concatenated(self) -> WorldMotion:
        """What the baseline makes of it."""
        return concatenated(shot_results_of(self.video, self.start))

    @functools.cached_property
    def refined(self) -> WorldMotion:
        """What `refine` makes of that: the pipeline's own result."""
        return self.refine(self.start, self.world)

    def again(self, start: Beginning) -> WorldMotion:
        """The pipeline's own stages after another beginning."""
        return self.refine(start, self.align(start))

    def align(
        self, start: Beginning, *, known_rotations: KnownRotations | None = None, witnesses: Set[str] = WITNESSES
    ) -> WorldMotion:
        """The stage `align` with the user's method."""
        how = load("align.method", self.config.align.method)
        results = shot_results_of(self.video, start)
        return align(results, method=how, known_rotations=known_rotations, witnesses=witnesses)

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
        if method not in _RECOVERED:
            raise ValueError(f"no method is called {method!r}")
        return MethodMotion(method, _RECOVERED[method](stages), _start_of(method, stages).shots)
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


def _without(witness: str, stages: _SharedStages) -> WorldMotion:
    """One witness left out; the same as with it where it had nothing to see."""
    results = shot_results_of(stages.video, stages.start)
    pictures = {
        "background": results.key_frames,
        "walls": results.key_frames,
        "shadows": results.ground,
        "floors": results.pictures,
    }
    if witness in pictures and not any(pictures[witness]):
        return stages.refined
    return stages.refine(stages.start, stages.align(stages.start, witnesses=WITNESSES - {witness}))


def _without_swap_correction(stages: _SharedStages) -> WorldMotion:
    if not _any_left_right_swap(stages.start.shots):
        return stages.refined
    return stages.again(stages.as_labelled)


def _refined_otherwise(changes: Mapping[str, bool | str], stages: _SharedStages) -> WorldMotion:
    return stages.refine(stages.start, stages.world, **changes)


def _with_eight_point(stages: _SharedStages) -> WorldMotion:
    results = shot_results_of(stages.video, stages.start)
    return stages.refine(stages.start, align(results, method=align_by_eight_point))


def _with_rotations(stages: _SharedStages, rotations: KnownRotations, start: Beginning | None = None) -> WorldMotion:
    """`rotations` from the truth at every cut, from `start` or what the stages begin with."""
    start = start or stages.start
    return stages.refine(start, stages.align(start, known_rotations=rotations))


def _true_rotations(stages: _SharedStages) -> KnownRotations:
    return true_rotations(stages.video, stages.start.shots)


_RECOVERED: Mapping[str, Callable[[_SharedStages], WorldMotion]] = {
    "humanmm": lambda stages: stages.refined,
    "humanmm without refine": lambda stages: stages.world,
    "concat": lambda stages: stages.concatenated,
    "humanmm without orientation alignment": lambda stages: stages.refine(stages.start, stages.concatenated),
    "humanmm with eight-point": _with_eight_point,
    "humanmm without pose prior": lambda stages: stages.again(stages.without_prior),
    "humanmm without masks": lambda stages: stages.again(stages.without_masks),
    "humanmm with static cameras": lambda stages: stages.again(stages.with_static_cameras),
    "humanmm without swap correction": _without_swap_correction,
    "oracle cuts": lambda stages: stages.cut_truly.refined,
    "oracle yaw": lambda stages: _with_rotations(stages, yaw_rotations(stages.video, stages.start.shots, stages.world)),
    "oracle camera rotation": lambda stages: _with_rotations(stages, _true_rotations(stages)),
    "oracle camera": lambda stages: _with_rotations(stages, _true_rotations(stages), stages.with_true_cameras),
    **{method: functools.partial(_without, witness) for method, witness in _WITNESS_LEFT_OUT.items()},
    **{method: functools.partial(_refined_otherwise, changes) for method, changes in _REFINED_OTHERWISE.items()},
}
"""What each method makes of a video."""


def _any_left_right_swap(shots: ShotList) -> bool:
    return any(appearance.left_right_swapped for shot in shots.shots for appearance in shot.people)
