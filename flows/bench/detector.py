"""What the stage `people` finds in clips with truths, beside the truth and beside what is simulated: see
scripts/measure_detector."""

import logging
from collections.abc import Iterator
from pathlib import Path

from humanmm.config import Config
from humanmm.flows.bench.clips import clip_set, results_of, run_stages
from humanmm.models.benchmark.methods import run_methods
from humanmm.models.benchmark.scores import score
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.synthetic.detector_errors import MeasuredClip, person_errors
from humanmm.models.synthetic.detector_noise import fitted_noise
from humanmm.models.synthetic.multishot import BenchVideo
from humanmm.models.synthetic.resimulated import resimulated
from humanmm.storage.readers.truth import read_sequence
from humanmm.storage.store.store import Store

log = logging.getLogger(__name__)

STAGES = ("decode", "scenes", "people")
SEED = 1


def measured_clips(folder: Path, config: Config, store: Store) -> list[MeasuredClip]:
    """All clips of a folder; what the store has is not computed again."""
    jobs, _ = clip_set(folder, store)
    clips = []
    for job in jobs:
        assert job.video is not None and job.truth is not None
        run = run_stages(job.video, STAGES, config, store)
        sequence = read_sequence(job.truth)
        clips.append(MeasuredClip(sequence, person_errors(sequence, results_of(run, "people", ScenePeople), job.name)))
    return clips


def compared_clips(folder: Path, config: Config, store: Store) -> Iterator[tuple[dict[str, float], dict[str, float]]]:
    """The whole pipeline's figures on every clip of one person: from what the network saw, and from simulated
    detections on the same clip."""
    jobs, _ = clip_set(folder, store)
    for job in jobs:
        assert job.truth is not None
        if len(read_sequence(job.truth).people) != 1:
            continue
        video = job.make(config, store)
        seen = _figures(video, config)
        simulated = _figures(resimulated(video, fitted_noise(), SEED), config)
        if seen and simulated:
            yield seen, simulated
        else:
            log.warning("%s is left out: nobody was found in it", job.name)


def _figures(video: BenchVideo, config: Config) -> dict[str, float]:
    measured = score(video, run_methods(video, config, ("humanmm",))).methods[0]
    return {figure.name: figure.value for figure in measured.figures}
