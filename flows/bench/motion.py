"""`humanmm bench ms-mocap | ms-aist | ms-render | ms-real`: how well every method recovers motion, video by video.

Each video's motions and figures are artifacts of the store. The key of the motions names the code and settings that
make them, the key of the figures also the code of the metrics: a change of a metric reads the motions again, a repeat
reads figures only.
"""

import functools
import hashlib
import json
import logging
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np

from humanmm.config import Config
from humanmm.errors import HumanMMError, InputError, StoreError
from humanmm.models.benchmark.methods import METHODS, VideoMotions, run_methods
from humanmm.models.benchmark.scores import MethodFigures, VideoFigures, score, sequence_of
from humanmm.models.benchmark.tables.statistics import SetStatistics, statistics_of
from humanmm.models.benchmark.traces import VideoTraces, trace_video
from humanmm.models.synthetic.mocap import MocapSequence
from humanmm.models.synthetic.multishot import (
    LONGEST_FRAMES,
    BenchVideo,
    Filmed,
    VideoPlan,
    build_video,
    plan_videos,
    split_name,
)
from humanmm.storage.readers.mocap_pack import read_pack
from humanmm.storage.store.open import open_store
from humanmm.storage.store.recipe import Recipe
from humanmm.storage.store.store import Store
from humanmm.tasks.units.digest import CodeDigest, code_digest
from humanmm.tasks.units.process import in_processes, prepare_process
from humanmm.version import __version__

log = logging.getLogger(__name__)
T = TypeVar("T")

SEED = 2025
SIZES = {
    "tiny": (1, (2, 3), 72),
    "standard": (60, (2, 3, 4), LONGEST_FRAMES),
    "ms20": (20, (2, 3, 4), LONGEST_FRAMES),
}
"""Videos for each number of transitions, these numbers, and the longest video in frames."""
SETTINGS = ("shots", "intrinsics", "camera", "hmr", "align", "refine")
"""Sections of the configuration that change a motion here."""
MOTION_CODE, FIGURE_CODE = "humanmm.models.benchmark.methods", "humanmm.models.benchmark.scores"
TRACE_CODE = "humanmm.models.benchmark.traces"
FEW = 3
"""So many videos are computed in this process: starting others would take longer."""


class Job(Protocol):
    """One video of a set, before it is made."""

    @property
    def name(self) -> str: ...

    @property
    def split(self) -> str: ...

    @property
    def parameters(self) -> dict[str, Any]:
        """Everything that the video is made of, as json."""
        ...

    @property
    def inputs(self) -> dict[str, str]:
        """Digests of the data that it is made of."""
        ...

    @property
    def stages(self) -> tuple[str, ...]:
        """Modules whose code makes the video, besides the methods' own."""
        ...

    @property
    def settings(self) -> tuple[str, ...]:
        """Sections of the configuration that change its motions."""
        ...

    def build(self, config: Config, store: Store) -> BenchVideo:
        """The video itself; HumanMMError where it cannot be had, which counts as a failure of all methods."""
        ...


@dataclass(frozen=True)
class PlannedJob:
    """A video that is made on the spot, as a plan says."""

    plan: VideoPlan

    @property
    def name(self) -> str:
        return self.plan.name

    @property
    def split(self) -> str:
        return split_name(self.plan.num_transitions)

    @property
    def settings(self) -> tuple[str, ...]:
        return SETTINGS


@dataclass(frozen=True)
class MocapJob(PlannedJob):
    """A video of ms-Mocap."""

    sequence: MocapSequence

    @property
    def parameters(self) -> dict[str, Any]:
        plan = asdict(self.plan)
        noise = hashlib.sha256(json.dumps(plan["noise"], sort_keys=True).encode()).hexdigest()
        return {**plan, "seed": list(self.plan.seed), "noise": noise}

    @property
    def inputs(self) -> dict[str, str]:
        total = hashlib.sha256(f"{self.sequence.fps} {self.sequence.leg_m}".encode())
        one = self.sequence
        for array in (one.R_world_root, one.body_pose, one.pelvis, one.contacts):
            total.update(np.ascontiguousarray(array).tobytes())
        return {"sequence": total.hexdigest()}

    @property
    def stages(self) -> tuple[str, ...]:
        return ()

    def build(self, config: Config, store: Store) -> BenchVideo:
        """Made on the spot."""
        return build_video(self.sequence, self.plan)


def mocap_set(pack: Path, size: str) -> tuple[list[MocapJob], SetStatistics]:
    """The videos of ms-Mocap in one of its sizes, and the set in numbers."""
    sequences = read_pack(pack)
    plans, facts = planned_set(pack, sequences, size)
    return [MocapJob(plan, sequences[plan.sequence]) for plan in plans], facts


def planned_set(source: Path, sequences: Sequence[Filmed], size: str) -> tuple[tuple[VideoPlan, ...], SetStatistics]:
    """How the videos of a set in one of its sizes are cut from the sequences of `source`, and the set in numbers."""
    count, transitions, longest = SIZES[size]
    try:
        plans = plan_videos(sequences, count, seed=SEED, transitions=transitions, same=size == "ms20", longest=longest)
    except ValueError as error:
        raise InputError(f"{source}: {error}") from None
    used = [sequences[plan.sequence] for plan in plans]
    lengths = [min(sequence.num_frames, plan.longest) for sequence, plan in zip(used, plans, strict=True)]
    return plans, statistics_of(lengths, [sequence.fps for sequence in used], [plan.num_transitions for plan in plans])


@dataclass(frozen=True)
class VideoRecipes:
    """Everything that decides what is kept of one video."""

    motions: Recipe
    figures: Recipe
    traces: Recipe


def figures_of(
    jobs: Sequence[Job], config: Config, store: Store, methods: tuple[str, ...] = METHODS
) -> list[VideoFigures]:
    """Every method's figures on every video: from the store, or computed now by `run.threads` processes."""
    prepare_process()
    recipes = [recipes_of(job, config, methods) for job in jobs]
    done: dict[int, VideoFigures] = {}
    for index, recipe in enumerate(recipes):
        manifest = store.find(recipe.figures.stage, recipe.figures.key)
        if manifest is not None:
            done[index] = store.read(manifest.ref, VideoFigures)
    missing = [index for index in range(len(jobs)) if index not in done]
    for index, figures in _computed(missing, jobs, recipes, config, store, methods):
        done[index] = figures
        log.info("%s: %d of %d videos", jobs[index].name, len(done), len(jobs))
    return [done[index] for index in range(len(jobs))]


def traces_of(
    jobs: Sequence[Job], config: Config, store: Store, methods: tuple[str, ...] = METHODS
) -> list[VideoTraces | None]:
    """What a report draws of every video, kept beside the figures; None for a video that cannot be had."""
    recipes = [recipes_of(job, config, methods) for job in jobs]
    kept = [store.find(recipe.traces.stage, recipe.traces.key) for recipe in recipes]
    missing = [index for index, manifest in enumerate(kept) if manifest is None]
    for index, _ in _computed(missing, jobs, recipes, config, store, methods):
        kept[index] = store.find(recipes[index].traces.stage, recipes[index].traces.key)
    return [None if manifest is None else store.read(manifest.ref, VideoTraces) for manifest in kept]


def _computed(
    missing: Sequence[int],
    jobs: Sequence[Job],
    recipes: Sequence[VideoRecipes],
    config: Config,
    store: Store,
    methods: tuple[str, ...],
) -> Iterator[tuple[int, VideoFigures]]:
    if len(missing) <= FEW or config.run.threads == 1:
        for index in missing:
            yield index, compute(jobs[index], recipes[index], config, store.location, methods)
        return
    calls = [(jobs[index], recipes[index], config, store.location, methods) for index in missing]
    for number, figures in in_processes(compute, calls, config.run.threads):
        yield missing[number], figures


def compute(job: Job, recipes: VideoRecipes, config: Config, place: str, methods: tuple[str, ...]) -> VideoFigures:
    """One video's figures, its traces beside them; its motions are taken from the store where it has them.

    Runs in a process of its own.
    """
    store = open_store(place)
    try:
        video = job.build(config, store)
    except HumanMMError as error:
        failed = tuple(MethodFigures(method, (), (), str(error)) for method in methods)
        return VideoFigures(job.name, job.split, failed)

    found = kept(store, recipes.motions, job.name, VideoMotions, lambda: run_methods(video, config, methods))

    def traces() -> VideoTraces:
        sequences = [(done.method, sequence_of(video, done) if done.motion else None) for done in found.motions]
        return trace_video(video.name, video.split, video.truth, sequences)

    kept(store, recipes.traces, job.name, VideoTraces, traces)
    return kept(store, recipes.figures, job.name, VideoFigures, lambda: score(video, found))


def kept(store: Store, recipe: Recipe, unit: str, output: type[T], make: Any) -> T:
    """The artifact of a recipe, made if the store has none."""
    with store.lock(recipe.stage, recipe.key):
        manifest = store.find(recipe.stage, recipe.key)
        if manifest is not None:
            try:
                return store.read(manifest.ref, output)
            except StoreError as error:
                log.warning("%s; it is made again", error)
        began = time.monotonic()
        with store.new_folder() as folder:
            result: T = make()
            store.commit(
                folder, result, output, recipe, unit=unit, seconds=time.monotonic() - began, version=__version__
            )
        return result


def recipes_of(job: Job, config: Config, methods: tuple[str, ...]) -> VideoRecipes:
    """What decides a video's motions, and what is made of them."""
    code = code_of(MOTION_CODE, *job.stages)
    settings: Mapping[str, Any] = {name: getattr(config, name).model_dump(mode="json") for name in job.settings}
    motions = Recipe(
        stage="bench-motions",
        schema_version=1,
        unit={**job.parameters, "methods": list(methods)},
        modules=code.modules,
        weights=code.weights,
        libraries=code.libraries,
        settings=settings,
        inputs=job.inputs,
    )
    return VideoRecipes(
        motions=motions,
        figures=_made_of(motions, "bench-figures", code_of(FIGURE_CODE), job),
        traces=_made_of(motions, "bench-traces", code_of(FIGURE_CODE, TRACE_CODE), job),
    )


def _made_of(motions: Recipe, stage: str, code: CodeDigest, job: Job) -> Recipe:
    return Recipe(
        stage=stage,
        schema_version=1,
        unit={"video": job.name},
        modules=code.modules,
        weights=code.weights,
        libraries=code.libraries,
        settings={},
        inputs={"motions": motions.key},
    )


@functools.cache
def code_of(*modules: str) -> CodeDigest:
    """The code of several modules together."""
    parts = [code_digest(module) for module in modules]
    return CodeDigest(
        modules={name: digest for part in parts for name, digest in part.modules.items()},
        weights={name: digest for part in parts for name, digest in part.weights.items()},
        libraries={name: version for part in parts for name, version in part.libraries.items()},
    )
