"""Rows of other systems beside ours: `humanmm bench … --imported NAME=FOLDER`, a result of theirs for every video."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from humanmm.config import Config
from humanmm.errors import HumanMMError, InputError
from humanmm.flows.bench.motion import FIGURE_CODE, Job, code_of, failed_job, kept, recipe, settings_of
from humanmm.models.benchmark.methods import ABLATIONS, METHODS
from humanmm.models.benchmark.scores import CutError, MethodFigures, VideoFigures, failed, score_sequence
from humanmm.parts import chosen
from humanmm.storage.readers.systems import READER_VERSION, find_result, read_result
from humanmm.storage.store.store import Store

CONVERSION_CODE = "humanmm.models.benchmark.imported"


@dataclass(frozen=True)
class System:
    """Another system's results: FOLDER/<video>.pt, .pkl or .npz."""

    name: str
    folder: Path


def parse_system(text: str) -> System:
    """NAME=FOLDER; InputError if it is not, or the name is one of ours."""
    name, separator, folder = text.partition("=")
    if not separator or not name.strip() or not folder:
        raise InputError(f"--imported {text}: expected NAME=FOLDER, such as GVHMR=results/gvhmr")
    if name in (*METHODS, *ABLATIONS):
        raise InputError(f"--imported {text}: {name!r} is the name of a method of this benchmark; choose another")
    if not Path(folder).is_dir():
        raise InputError(f"--imported {text}: {folder} is not a folder")
    return System(name, Path(folder))


def with_imported(
    jobs: Sequence[Job], done: Sequence[VideoFigures], systems: Sequence[System], config: Config, store: Store
) -> list[VideoFigures]:
    """The figures with those of other systems; a video without a result of theirs is a failure of theirs."""
    return [
        replace(video, methods=(*video.methods, *(_figures(job, system, video, config, store) for system in systems)))
        for job, video in zip(jobs, done, strict=True)
    ]


def _figures(job: Job, system: System, ours: VideoFigures, config: Config, store: Store) -> MethodFigures:
    path = find_result(system.folder, job.name)
    if path is None:
        lost = tuple(CutError(cut.angle_deg, None, frame=cut.frame) for cut in ours.methods[0].cuts)
        return MethodFigures(system.name, (), lost, f"{system.folder.name} holds no single result for {job.name}")
    decided_by = recipe(
        "bench-imported",
        code_of(CONVERSION_CODE, FIGURE_CODE, *job.modules, parts=chosen(config, job.settings)),
        unit={**job.parameters, "system": system.name},
        settings=settings_of(job, config),
        inputs={**job.inputs, "result": hashlib.sha256(path.read_bytes()).hexdigest()},
        schema_version=READER_VERSION,
    )

    def compute() -> MethodFigures:
        try:
            truth = job.make(config, store).truth
        except HumanMMError as error:
            return failed_job(job, system.name, str(error))
        try:
            taken = read_result(path, num_frames=truth.num_frames, fps=truth.fps)
        except HumanMMError as error:
            return failed(system.name, truth, str(error))
        return score_sequence(system.name, taken, truth)

    return kept(store, decided_by, job.name, MethodFigures, compute)
