"""`humanmm bench ms-render | ms-real`: a folder of clips with truths, from their pixels.

The stages up to `points` are those of `humanmm recover`, on the same store; from there on all methods of
`motion_benchmark` run in memory.
"""

import hashlib
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from humanmm.config import Config
from humanmm.errors import InputError, StageError
from humanmm.flows.bench.motion import SETTINGS
from humanmm.models.benchmark.tables.statistics import SetStatistics, statistics_of
from humanmm.models.camera.keyframes import KeyFrameFeatures
from humanmm.models.records.camera import PointTracks
from humanmm.models.records.sequence import MotionSequence
from humanmm.models.records.shots import Scenes
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.models.synthetic.multishot import BenchVideo, split_name
from humanmm.storage.readers.truth import read_sequence
from humanmm.storage.store.identity import identify
from humanmm.storage.store.store import Store
from humanmm.tasks.engine.run import VideoRun
from humanmm.tasks.pipeline import STAGES

log = logging.getLogger(__name__)
T = TypeVar("T")

OF_PIXELS = ("decode", "scenes", "people", "shots", "keyframes", "points")
"""Stages whose results the methods start from."""


@dataclass(frozen=True)
class ClipJob:
    """One clip of a folder."""

    video: Path
    truth: Path
    num_transitions: int
    video_sha256: str
    truth_sha256: str

    @property
    def name(self) -> str:
        return self.video.stem

    @property
    def split(self) -> str:
        return split_name(self.num_transitions)

    @property
    def parameters(self) -> dict[str, Any]:
        return {"video": self.name}

    @property
    def inputs(self) -> dict[str, str]:
        return {"video": self.video_sha256, "truth": self.truth_sha256}

    @property
    def stages(self) -> tuple[str, ...]:
        return tuple(f"humanmm.tasks.{stage}" for stage in OF_PIXELS)

    @property
    def settings(self) -> tuple[str, ...]:
        pixels = [section for stage in STAGES if stage.name in OF_PIXELS for section in stage.settings]
        return (*pixels, *(section for section in SETTINGS if section not in pixels))

    def build(self, config: Config, store: Store) -> BenchVideo:
        """Observations from the clip's pixels; StageError if a stage fails on a part of it."""
        run = VideoRun(identify(self.video, store), config, store)
        for name in OF_PIXELS:
            for work in run.works(run.stage(name)) or ():
                outcome = run.do(work)
                if outcome.manifest is None:
                    raise StageError(f"{self.name}: {outcome.work.label} failed: {outcome.reason}")
        return BenchVideo(
            name=self.name,
            split=self.split,
            facts=results_of(run, "decode", VideoFacts)[0],
            scenes=results_of(run, "scenes", Scenes)[0],
            people=tuple(results_of(run, "people", ScenePeople)),
            points=tuple(results_of(run, "points", PointTracks)),
            key_frames=tuple(one for shot in results_of(run, "keyframes", KeyFrameFeatures)[0].of_shot for one in shot),
            truth=read_sequence(self.truth),
        )


def clip_set(folder: Path, store: Store) -> tuple[list[ClipJob], SetStatistics]:
    """All pairs <name>.mp4 and <name>_gt.npz of a folder, by name, and the set in numbers."""
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder; give one that holds <name>.mp4 beside <name>_gt.npz")
    jobs: list[ClipJob] = []
    truths: list[MotionSequence] = []
    for path in sorted(folder.glob("*_gt.npz")):
        video = path.with_name(f"{path.name.removesuffix('_gt.npz')}.mp4")
        if not video.is_file():
            log.warning("%s has no video %s beside it and is left out", path.name, video.name)
            continue
        truth = read_sequence(path)
        truths.append(truth)
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        jobs.append(ClipJob(video, path, len(truth.transitions), identify(video, store).sha256, digest))
    if not jobs:
        raise InputError(f"{folder} holds no <name>.mp4 beside a <name>_gt.npz")
    jobs.sort(key=lambda job: (job.num_transitions, job.name))
    facts = statistics_of(
        [truth.num_frames for truth in truths],
        [truth.fps for truth in truths],
        [len(truth.transitions) for truth in truths],
    )
    return jobs, facts


def results_of(run: VideoRun, stage: str, output: type[T]) -> Sequence[T]:
    """What the units of a stage have left in the store."""
    works = run.works(run.stage(stage)) or ()
    manifests = [run.manifest(stage, work.index) for work in works]
    return [run.store.read(manifest.ref, output) for manifest in manifests if manifest is not None]
