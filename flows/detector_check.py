"""What the stage `people` finds in clips with truths, beside the truth: see scripts/measure_detector."""

from pathlib import Path

from humanmm.config import Config
from humanmm.errors import StageError
from humanmm.flows.clip_benchmark import clip_set, results_of
from humanmm.models.benchmark.detector_errors import MeasuredClip, person_errors
from humanmm.models.perception.tracks import ScenePeople
from humanmm.storage.store import Store
from humanmm.storage.truth import read_take
from humanmm.storage.video_identity import identify
from humanmm.tasks.engine import VideoRun

STAGES = ("decode", "scenes", "people")


def measured_clips(folder: Path, config: Config, store: Store) -> list[MeasuredClip]:
    """All clips of a folder; what the store has is not computed again."""
    jobs, _ = clip_set(folder, store)
    clips = []
    for job in jobs:
        run = VideoRun(identify(job.video, store), config, store)
        for name in STAGES:
            for work in run.works(run.stage(name)) or ():
                outcome = run.do(work)
                if outcome.manifest is None:
                    raise StageError(f"{job.name}: {outcome.work.label} failed: {outcome.reason}")
        take = read_take(job.truth)
        clips.append(MeasuredClip(take, person_errors(take, results_of(run, "people", ScenePeople), job.name)))
    return clips
