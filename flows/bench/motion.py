"""How well every method recovers motion, video by video: motions, figures and traces of a benchmark's jobs.

Each video's motions and figures are artifacts of the store. The key of the motions names the code and settings that
make them, the key of the figures also the code of the metrics: a change of a metric reads the motions again, a repeat
reads figures only.
"""

import functools
import logging
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from humanmm.config import Config
from humanmm.errors import HumanMMError, StoreError
from humanmm.models.benchmark.methods import METHODS, VideoMotions, run_methods
from humanmm.models.benchmark.scores import MethodFigures, VideoFigures, failed, score, sequence_of
from humanmm.models.benchmark.traces import VideoTraces, trace_video
from humanmm.models.perception.lifting.lifted import lifted_people
from humanmm.models.synthetic.multishot import BenchVideo
from humanmm.parts import Part, chosen
from humanmm.storage.readers.truth import read_sequence
from humanmm.storage.store.open import open_store
from humanmm.storage.store.recipe import Recipe
from humanmm.storage.store.store import Store
from humanmm.tasks.people import lifter_of
from humanmm.tasks.units.digest import CodeDigest, code_digest
from humanmm.tasks.units.process import in_processes, prepare_process
from humanmm.version import __version__

log = logging.getLogger(__name__)
T = TypeVar("T")

SETTINGS = ("shots", "intrinsics", "camera", "hmr", "align", "refine")
"""Sections of the configuration that change a motion here."""

MOTION_CODE, FIGURE_CODE = "humanmm.models.benchmark.methods", "humanmm.models.benchmark.scores"
TRACE_CODE = "humanmm.models.benchmark.traces"
FEW = 3
"""So many videos are computed in this process: starting others would take longer."""


@dataclass(frozen=True)
class Job:
    """One video of a benchmark's set before it is made; jobs of all sets differ in these values alone."""

    name: str
    split: str
    parameters: Mapping[str, Any]
    """Everything that the video is made of, as json."""
    inputs: Mapping[str, str]
    """Digests of the data that it is made of."""
    make: Callable[[Config, Store], BenchVideo]
    """The video; raises HumanMMError where it cannot be had, which counts as a failure of all methods."""
    modules: tuple[str, ...] = ()
    """Modules whose code makes the video, besides the methods' own."""
    settings: tuple[str, ...] = SETTINGS
    """Sections of the configuration that change its motions."""
    video: Path | None = None
    """Its pictures, if it has any."""
    truth: Path | None = None
    """Its truth, if it is a file."""


@dataclass(frozen=True)
class VideoRecipes:
    """Everything that decides what is kept of one video."""

    motions: Recipe
    figures: Recipe
    traces: Recipe


def lifted(video: BenchVideo, config: Config) -> BenchVideo:
    """A video whose people are made up, lifted as the stage `people` lifts those that it sees."""
    lifter, size = lifter_of(config.lifting), (video.facts.width, video.facts.height)
    people = (lifted_people(scene, lifter, video.facts.time_s, size) for scene in video.people)
    return replace(video, people=tuple(people))


def without_lifter(config: Config) -> Config:
    """A configuration in which people keep the pose network's own landmarks."""
    return config.model_copy(update={"lifting": config.lifting.model_copy(update={"method": "none", "weights": None})})


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
        video = job.make(config, store)
    except HumanMMError as error:
        return VideoFigures(job.name, job.split, tuple(failed_job(job, method, str(error)) for method in methods))

    found = kept(store, recipes.motions, job.name, VideoMotions, lambda: run_methods(video, config, methods))

    def traces() -> VideoTraces:
        sequences = [(done.method, sequence_of(video, done) if done.motion else None) for done in found.motions]
        return trace_video(video.name, video.split, video.truth, sequences)

    kept(store, recipes.traces, job.name, VideoTraces, traces)
    return kept(store, recipes.figures, job.name, VideoFigures, lambda: score(video, found))


def failed_job(job: Job, method: str, reason: str) -> MethodFigures:
    """A method's failure on a video that cannot be had; its true cuts are known only where its truth is a file."""
    if job.truth is None:
        return MethodFigures(method, (), (), reason)
    return failed(method, read_sequence(job.truth), reason)


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
    motions = recipe(
        "bench-motions",
        code_of(MOTION_CODE, *job.modules, parts=chosen(config, job.settings)),
        unit={**job.parameters, "methods": list(methods)},
        settings=settings_of(job, config),
        inputs=job.inputs,
    )

    def made_of_it(stage: str, *modules: str) -> Recipe:
        return recipe(stage, code_of(*modules), unit={"video": job.name}, inputs={"motions": motions.key})

    return VideoRecipes(
        motions=motions,
        figures=made_of_it("bench-figures", FIGURE_CODE),
        traces=made_of_it("bench-traces", FIGURE_CODE, TRACE_CODE),
    )


def recipe(
    stage: str,
    code: CodeDigest,
    *,
    unit: Mapping[str, Any],
    inputs: Mapping[str, str],
    settings: Mapping[str, Any] | None = None,
    schema_version: int = 1,
) -> Recipe:
    """A recipe of the benchmark's own stages."""
    return Recipe(
        stage=stage,
        schema_version=schema_version,
        unit=unit,
        modules=code.modules,
        weights=code.weights,
        libraries=code.libraries,
        settings=settings or {},
        inputs=inputs,
    )


def settings_of(job: Job, config: Config) -> dict[str, Any]:
    """The sections of the configuration that change the job's motions, as json."""
    return {name: getattr(config, name).model_dump(mode="json") for name in job.settings}


@functools.cache
def code_of(*modules: str, parts: tuple[Part, ...] = ()) -> CodeDigest:
    """The code of several modules and of the replaceable parts that they load by name."""
    found = [code_digest(module, parts) for module in modules]
    return CodeDigest(
        modules={name: digest for code in found for name, digest in code.modules.items()},
        weights={name: digest for code in found for name, digest in code.weights.items()},
        libraries={name: version for code in found for name, version in code.libraries.items()},
    )
