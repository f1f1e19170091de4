"""`humanmm bench ms-mocap | ms-render | ms-real`: how well motion is recovered, by every method, video by video.

Each video's motions and figures are artifacts of the store. The key of the motions names the code and settings that
make them, the key of the figures also the code of the metrics: a change of a metric reads the motions again, a repeat
reads figures only.
"""

import functools
import hashlib
import logging
import multiprocessing
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np

from humanmm import __version__
from humanmm.config import Config
from humanmm.errors import HumanMMError, InputError, StoreError
from humanmm.models.benchmark.methods import METHODS, VideoMotions, run_methods
from humanmm.models.benchmark.mocap import MocapTake
from humanmm.models.benchmark.multishot import (
    LONGEST_FRAMES,
    BenchVideo,
    VideoPlan,
    build_video,
    plan_videos,
    split_name,
)
from humanmm.models.benchmark.scoring import MethodFigures, VideoFigures, score
from humanmm.models.benchmark.statistics import SetStatistics, statistics_of
from humanmm.storage.code_digest import CodeDigest, code_digest
from humanmm.storage.mocap_pack import read_pack
from humanmm.storage.recipe import Recipe
from humanmm.storage.store import Store
from humanmm.tasks.process import prepare_process

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
MOTION_CODE, FIGURE_CODE = "humanmm.models.benchmark.methods", "humanmm.models.benchmark.scoring"
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
class MocapJob:
    """A video of ms-Mocap."""

    take: MocapTake
    plan: VideoPlan

    @property
    def name(self) -> str:
        return self.plan.name

    @property
    def split(self) -> str:
        return split_name(self.plan.num_transitions)

    @property
    def parameters(self) -> dict[str, Any]:
        plan = asdict(self.plan)
        return {**plan, "seed": list(self.plan.seed), "noise": {k: _plain(v) for k, v in plan["noise"].items()}}

    @property
    def inputs(self) -> dict[str, str]:
        total = hashlib.sha256(f"{self.take.fps} {self.take.leg_m}".encode())
        for array in (self.take.R_world_root, self.take.body_pose, self.take.pelvis, self.take.contacts):
            total.update(np.ascontiguousarray(array).tobytes())
        return {"take": total.hexdigest()}

    @property
    def stages(self) -> tuple[str, ...]:
        return ()

    @property
    def settings(self) -> tuple[str, ...]:
        return SETTINGS

    def build(self, config: Config, store: Store) -> BenchVideo:
        """Made on the spot."""
        return build_video(self.take, self.plan)


def mocap_set(pack: Path, size: str) -> tuple[list[MocapJob], SetStatistics]:
    """The videos of ms-Mocap in one of its sizes, and the set in numbers."""
    takes = read_pack(pack)
    count, transitions, longest = SIZES[size]
    try:
        plans = plan_videos(takes, count, seed=SEED, transitions=transitions, same=size == "ms20", longest=longest)
    except ValueError as error:
        raise InputError(f"{pack}: {error}") from None
    jobs = [MocapJob(takes[plan.take], plan) for plan in plans]
    lengths = [min(job.take.num_frames, job.plan.longest) for job in jobs]
    facts = statistics_of(lengths, [job.take.fps for job in jobs], [plan.num_transitions for plan in plans])
    return jobs, facts


def figures_of(
    jobs: Sequence[Job], config: Config, store: Store, methods: tuple[str, ...] = METHODS
) -> list[VideoFigures]:
    """Every method's figures on every video: from the store, or computed now by `run.threads` processes."""
    prepare_process()
    recipes = [_recipes(job, config, _codes(job), methods) for job in jobs]
    done: dict[int, VideoFigures] = {}
    for index, (_, of_figures) in enumerate(recipes):
        manifest = store.find(of_figures.stage, of_figures.key)
        if manifest is not None:
            done[index] = store.read(manifest.ref, VideoFigures)
    missing = [index for index in range(len(jobs)) if index not in done]
    for index, figures in _computed(missing, jobs, recipes, config, store, methods):
        done[index] = figures
        log.info("%s: %d of %d videos", jobs[index].name, len(done), len(jobs))
    return [done[index] for index in range(len(jobs))]


def _computed(
    missing: Sequence[int],
    jobs: Sequence[Job],
    recipes: Sequence[tuple[Recipe, Recipe]],
    config: Config,
    store: Store,
    methods: tuple[str, ...],
) -> Iterator[tuple[int, VideoFigures]]:
    if len(missing) <= FEW or config.run.threads == 1:
        for index in missing:
            yield index, compute(jobs[index], recipes[index], config, store.root, methods)
        return
    fresh = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(config.run.threads, mp_context=fresh, initializer=prepare_process) as pool:
        futures = {
            pool.submit(compute, jobs[index], recipes[index], config, store.root, methods): index for index in missing
        }
        try:
            for future in as_completed(futures):
                yield futures[future], future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def compute(
    job: Job, recipes: tuple[Recipe, Recipe], config: Config, store_root: Path, methods: tuple[str, ...]
) -> VideoFigures:
    """One video's figures; its motions are taken from the store where it has them. Runs in a process of its own."""
    store = Store(store_root)
    of_motions, of_figures = recipes
    try:
        video = job.build(config, store)
    except HumanMMError as error:
        failed = tuple(MethodFigures(method, (), (), str(error)) for method in methods)
        return VideoFigures(job.name, job.split, failed)

    found = _kept(store, of_motions, job.name, VideoMotions, lambda: run_methods(video, config, methods))
    return _kept(store, of_figures, job.name, VideoFigures, lambda: score(video, found))


def _kept(store: Store, recipe: Recipe, unit: str, output: type[T], make: Any) -> T:
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


def _codes(job: Job) -> tuple[CodeDigest, CodeDigest]:
    """Code of a video's motions, and of its figures."""
    return _code(MOTION_CODE, *job.stages), _code(FIGURE_CODE)


def _recipes(
    job: Job, config: Config, codes: tuple[CodeDigest, CodeDigest], methods: tuple[str, ...]
) -> tuple[Recipe, Recipe]:
    of_motions, of_metrics = codes
    settings: Mapping[str, Any] = {name: getattr(config, name).model_dump(mode="json") for name in job.settings}
    motions = Recipe(
        stage="bench-motions",
        schema_version=1,
        unit={**job.parameters, "methods": list(methods)},
        modules=of_motions.modules,
        weights=of_motions.weights,
        libraries=of_motions.libraries,
        settings=settings,
        inputs=job.inputs,
    )
    figures = Recipe(
        stage="bench-figures",
        schema_version=1,
        unit={"video": job.name},
        modules=of_metrics.modules,
        weights=of_metrics.weights,
        libraries=of_metrics.libraries,
        settings={},
        inputs={"motions": motions.key},
    )
    return motions, figures


@functools.cache
def _code(*modules: str) -> CodeDigest:
    """The code of several modules together."""
    parts = [code_digest(module) for module in modules]
    return CodeDigest(
        modules={name: digest for part in parts for name, digest in part.modules.items()},
        weights={name: digest for part in parts for name, digest in part.weights.items()},
        libraries={name: version for part in parts for name, version in part.libraries.items()},
    )


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value
