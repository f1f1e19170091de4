"""The sets that are made on the spot from a plan: ms-mocap from motion capture, ms-aist from AIST++'s detections."""

import functools
import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TypeVar

import numpy as np

from humanmm.config import Config
from humanmm.errors import InputError
from humanmm.flows.bench.motion import SETTINGS, Job, lifted
from humanmm.models.benchmark.aist import AistSequence, build_aist
from humanmm.models.benchmark.tables.statistics import SetStatistics, statistics_of
from humanmm.models.synthetic.mocap import MocapSequence
from humanmm.models.synthetic.multishot import (
    LONGEST_FRAMES,
    BenchVideo,
    Performance,
    VideoPlan,
    build_video,
    plan_videos,
    split_name,
)
from humanmm.parts import load
from humanmm.storage.readers.aist import read_aist
from humanmm.storage.readers.mocap_pack import read_pack
from humanmm.storage.store.store import Store

Performed = TypeVar("Performed", bound=Performance)

SEED = 2025
SIZES = {
    "tiny": (1, (2, 3), 72),
    "standard": (60, (2, 3, 4), LONGEST_FRAMES),
    "ms20": (20, (2, 3, 4), LONGEST_FRAMES),
}
"""Videos for each number of transitions, these numbers, and the longest video in frames."""


def mocap_set(pack: Path, size: str) -> tuple[list[Job], SetStatistics]:
    """The videos of ms-Mocap in one of its sizes, and the set in numbers."""
    return _planned_set(pack, read_pack(pack), size, _mocap_job)


def aist_set(folder: Path, size: str) -> tuple[list[Job], SetStatistics]:
    """The videos of ms-AIST in one of its sizes, and the set in numbers."""
    return _planned_set(folder, read_aist(folder), size, _aist_job)


def _planned_set(
    source: Path, sequences: Sequence[Performed], size: str, job_of: Callable[[VideoPlan, Performed], Job]
) -> tuple[list[Job], SetStatistics]:
    """The videos of a set in one of its sizes, cut from the sequences of `source`, and the set in numbers."""
    count, transitions, longest = SIZES[size]
    try:
        plans = plan_videos(sequences, count, seed=SEED, transitions=transitions, same=size == "ms20", longest=longest)
    except ValueError as error:
        raise InputError(f"{source}: {error}") from None
    used = [sequences[plan.sequence] for plan in plans]
    lengths = [min(sequence.num_frames, plan.longest) for sequence, plan in zip(used, plans, strict=True)]
    facts = statistics_of(lengths, [sequence.fps for sequence in used], [plan.num_transitions for plan in plans])
    return [job_of(plan, sequence) for plan, sequence in zip(plans, used, strict=True)], facts


def _mocap_job(plan: VideoPlan, sequence: MocapSequence) -> Job:
    digest = hashlib.sha256(f"{sequence.fps} {sequence.leg_m}".encode())
    for array in (sequence.R_world_root, sequence.body_pose, sequence.pelvis, sequence.contacts):
        digest.update(np.ascontiguousarray(array).tobytes())
    values = asdict(plan)
    noise = hashlib.sha256(json.dumps(values["noise"], sort_keys=True).encode()).hexdigest()
    return Job(
        name=plan.name,
        split=split_name(plan.num_transitions),
        parameters={**values, "seed": list(plan.seed), "noise": noise},
        inputs={"sequence": digest.hexdigest()},
        make=functools.partial(_make_mocap, sequence, plan),
        settings=("lifting", *SETTINGS),
    )


def _aist_job(plan: VideoPlan, sequence: AistSequence) -> Job:
    values = {"name": plan.name, "num_transitions": plan.num_transitions, "longest": plan.longest}
    return Job(
        name=plan.name,
        split=split_name(plan.num_transitions),
        parameters={**values, "seed": list(plan.seed)},
        inputs={"sequence": sequence.sha256},
        make=functools.partial(_make_aist, sequence, plan),
        modules=("humanmm.models.benchmark.aist",),
        settings=("lifting", *SETTINGS),
    )


def _make_mocap(sequence: MocapSequence, plan: VideoPlan, config: Config, store: Store) -> BenchVideo:
    return lifted(build_video(sequence, plan), config)


def _make_aist(sequence: AistSequence, plan: VideoPlan, config: Config, store: Store) -> BenchVideo:
    return build_aist(sequence, plan, lifter=load("lifting.keypoints", config.lifting.keypoints))
