"""`humanmm bench ms-render | ms-real`: a folder of clips with truths, from their pixels.

The stages up to `points` are those of `humanmm recover`, on the same store; from there on all methods run in memory.
What the stage `people` finds in the clips, beside their truths: see scripts/measure_detector.
"""

import functools
import hashlib
import json
import logging
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from humanmm.config import Config
from humanmm.errors import HumanMMError, InputError
from humanmm.flows.bench.motion import SETTINGS, Job, lifted, without_lifter
from humanmm.models.benchmark.golden import SeenClip
from humanmm.models.benchmark.methods import run_methods
from humanmm.models.benchmark.scores import score
from humanmm.models.benchmark.tables.groups import ClipLabels, labels_of
from humanmm.models.benchmark.tables.statistics import SetStatistics, statistics_of
from humanmm.models.camera.background.keyframes import KeyFrameFeatures
from humanmm.models.evaluation.cameras import known, stands_in_two_places
from humanmm.models.evaluation.doubts import Judgement, judged
from humanmm.models.motion.assemble import record_motion
from humanmm.models.records.camera import PointTracks, ShotCamera
from humanmm.models.records.motion import WorldMotion
from humanmm.models.records.sequence import MotionSequence
from humanmm.models.records.shots import Scenes, ShotList
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.models.synthetic.detector_errors import MeasuredClip, person_errors
from humanmm.models.synthetic.detector_noise import fitted_noise
from humanmm.models.synthetic.multishot import BenchVideo, split_name
from humanmm.models.synthetic.resimulated import resimulated
from humanmm.models.video.reading import read_facts
from humanmm.storage.readers.archives import NpzArrays
from humanmm.storage.readers.truth import read_sequence
from humanmm.storage.run_folder.run_record import read_run_record
from humanmm.storage.store.identity import identify
from humanmm.storage.store.store import Store
from humanmm.tasks.engine.finish import write_results
from humanmm.tasks.engine.some_stages import results_of, run_stages
from humanmm.tasks.pipeline import STAGES
from humanmm.tasks.units.process import prepare_process

log = logging.getLogger(__name__)

OF_PIXELS = ("decode", "scenes", "people", "shots", "keyframes", "points")
"""Stages whose results the methods start from."""
OF_PEOPLE = ("decode", "scenes", "people")
"""Stages that find people."""
_SEED = 1


def recovered(video: Path, config: Config, store: Store) -> SeenClip:
    """What `humanmm recover` makes of a video, without its pictures; a video that it refuses has a reason instead."""
    names = [stage.name for stage in STAGES if stage.name != "deliver"]
    try:
        run = run_stages(video, names, config, store)
    except HumanMMError as error:
        with video.open("rb") as stream:
            num_frames = read_facts(stream).num_frames
        return SeenClip(num_frames, None, {}, refused=str(error).removeprefix(f"{video}: "))
    (facts,), (shots,) = results_of(run, "decode", VideoFacts), results_of(run, "shots", ShotList)
    (motion,) = results_of(run, "refine", WorldMotion)
    cameras = results_of(run, "camera", ShotCamera)
    return SeenClip(
        num_frames=facts.num_frames,
        recording=record_motion(facts, shots, results_of(run, "people", ScenePeople), motion),
        linked={cut.cut_frame: cut.linked for cut in motion.cuts},
        warnings=(
            *facts.warnings,
            *shots.warnings,
            *(text for one in cameras for text in one.warnings),
            *motion.warnings,
        ),
    )


def clip_set(folder: Path, store: Store) -> tuple[list[Job], SetStatistics]:
    """All pairs <name>.mp4 and <name>_gt.npz of a folder, by name, and the set in numbers.

    A folder without any holds sets in its subfolders: `dev` beside `test`.
    """
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder; give one that holds <name>.mp4 beside <name>_gt.npz")
    truths: dict[Path, MotionSequence] = {}
    for path in sorted(folder.glob("*_gt.npz")) or sorted(folder.glob("*/*_gt.npz")):
        video = video_beside(path)
        if not video.is_file():
            log.warning("%s has no video %s beside it and is left out", path.name, video.name)
            continue
        truths[path] = read_sequence(path)
    if not truths:
        raise InputError(f"{folder} holds no <name>.mp4 beside a <name>_gt.npz")
    lengths, rates, transitions = zip(
        *((truth.num_frames, truth.fps, len(truth.transitions)) for truth in truths.values()), strict=True
    )
    ordered = sorted(truths, key=lambda path: (len(truths[path].transitions), path.name))
    return [_job(path, truths[path], store) for path in ordered], statistics_of(lengths, rates, transitions)


def judged_clips(folder: Path, config: Config, store: Store) -> tuple[list[Judgement], list[str]]:
    """What is wrong and what was doubted in every clip of a folder, each recovered as `humanmm recover` does; and a
    sentence for each that failed."""
    prepare_process()
    jobs, _ = clip_set(folder, store)
    found, failed = [], []
    for number, job in enumerate(jobs, start=1):
        assert job.video is not None and job.truth is not None
        try:
            run = run_stages(job.video, [stage.name for stage in STAGES], config, store)
            with tempfile.TemporaryDirectory(prefix="humanmm-doubts-") as out:
                write_results(run, Path(out), started=time.time())
                prediction = read_sequence(Path(out))
                found += judged(read_run_record(Path(out)), prediction, read_sequence(job.truth))
        except HumanMMError as error:
            failed.append(f"{job.name}: {error}")
        log.info("%s: %d of %d videos", job.name, number, len(jobs))
    return found, failed


def in_two_places(jobs: Sequence[Job]) -> int:
    """Of how many clips the true cameras stand in two places, so that `cam_ate_m` says nothing."""
    truths = [read_sequence(job.truth).cameras for job in jobs if job.truth is not None]
    centres = [cameras.t_world_cam[known(cameras)] for cameras in truths if cameras is not None]
    return sum(stands_in_two_places(one) for one in centres)


def labels_of_jobs(jobs: Sequence[Job]) -> dict[str, ClipLabels]:
    """What the clips show whose truth says so, by name."""
    found = {}
    for job in jobs:
        arrays = NpzArrays(job.truth) if job.truth is not None and job.truth.suffix == ".npz" else {}
        if "features" in arrays:
            try:
                found[job.name] = labels_of(json.loads(str(arrays["features"])))
            except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
                raise InputError(f"{job.truth}: features are not what `humanmm dataset build` writes") from None
    return found


def _job(path: Path, truth: MotionSequence, store: Store) -> Job:
    video = video_beside(path)
    split = split_name(len(truth.transitions))
    of_pixels = [section for stage in STAGES if stage.name in OF_PIXELS for section in stage.settings]
    digests = identify(video, store).sha256, hashlib.sha256(path.read_bytes()).hexdigest()
    return Job(
        name=video.stem,
        split=split,
        parameters={"video": video.stem},
        inputs=dict(zip(("video", "truth"), digests, strict=True)),
        make=functools.partial(_make, video, path, split),
        modules=tuple(f"humanmm.tasks.{stage}" for stage in OF_PIXELS),
        settings=tuple(dict.fromkeys((*of_pixels, *SETTINGS))),
        video=video,
        truth=path,
    )


def video_beside(truth: Path) -> Path:
    """The clip of a truth <name>_gt.npz, whether it is there or not."""
    return truth.with_name(f"{truth.name.removesuffix('_gt.npz')}.mp4")


def _make(video: Path, truth: Path, split: str, config: Config, store: Store) -> BenchVideo:
    """Observations from the clip's pixels; StageError if a stage fails on a part of it."""
    run = run_stages(video, OF_PIXELS, config, store)
    (seen,) = results_of(run, "keyframes", KeyFrameFeatures)
    return BenchVideo(
        name=video.stem,
        split=split,
        facts=results_of(run, "decode", VideoFacts)[0],
        scenes=results_of(run, "scenes", Scenes)[0],
        people=tuple(results_of(run, "people", ScenePeople)),
        points=tuple(results_of(run, "points", PointTracks)),
        key_frames=tuple(one for shot in seen.of_shot for one in shot),
        ground=tuple(one for shot in seen.ground for one in shot),
        pictures=tuple(one for shot in seen.pictures for one in shot),
        truth=read_sequence(truth),
    )


def measured_clips(folder: Path, config: Config, store: Store) -> list[MeasuredClip]:
    """All clips of a folder as the pose network sees them; what the store has is not computed again."""
    jobs, _ = clip_set(folder, store)
    clips = []
    for job in jobs:
        assert job.video is not None and job.truth is not None
        run = run_stages(job.video, OF_PEOPLE, without_lifter(config), store)
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
        simulated = _figures(lifted(resimulated(video, fitted_noise(), _SEED), config), config)
        if seen and simulated:
            yield seen, simulated
        else:
            log.warning("%s is left out: nobody was found in it", job.name)


def _figures(video: BenchVideo, config: Config) -> dict[str, float]:
    measured = score(video, run_methods(video, config, ("humanmm",))).methods[0]
    return {figure.name: figure.value for figure in measured.figures}
