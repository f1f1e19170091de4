"""Sets of pairs for the lifter and of looks for the keypoint refiner: rendered people, and what the shipped pose
networks see of them; resumes."""

import hashlib
import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from prefect import flow

from humanmm.flows.bench.render_set import Split, shipped_packs, takes_of
from humanmm.models.learning.landmark_looks import LookSource
from humanmm.models.learning.pairs import PairSource
from humanmm.models.perception.blazepose import HEAVY
from humanmm.models.perception.keypoints.surroundings import WEIGHTS as REFINER
from humanmm.models.rendering.places.crouching import CROUCHED
from humanmm.models.rendering.places.takes import Library
from humanmm.models.synthetic.mocap import MocapSequence
from humanmm.models.weights.shipped import manifest
from humanmm.storage.readers.mocap_pack import read_pack
from humanmm.storage.training.pair_set import PairSet, identity_of
from humanmm.tasks.units.digest import code_digest
from humanmm.tasks.units.process import made_in_processes, prepare_process

log = logging.getLogger(__name__)

GROUP = 16
"""Windows of a group: a minute or two of work, which is lost if the process is killed."""
Kind = Literal["pairs", "looks"]
SEEDS: dict[Kind, dict[Split, int]] = {
    "pairs": {"train": 7, "dev": 8, "test": 9},
    "looks": {"train": 17, "dev": 18, "test": 19},
}
"""Pairs show what a refiner does with people whom it has not learnt by heart."""
MODULES: dict[Kind, str] = {
    "pairs": "humanmm.models.learning.pairs",
    "looks": "humanmm.models.learning.landmark_looks",
}
LOOKED = (HEAVY, "movenet-thunder.tflite")
NETWORKS: dict[Kind, tuple[str, ...]] = {"pairs": (*LOOKED, REFINER), "looks": LOOKED}


@dataclass(frozen=True)
class PairPlan:
    """Which pairs, or which looks."""

    split: Split
    count: int
    """Windows of 32 frames; of looks, shots of as many."""
    packs: tuple[Path, ...]
    kind: Kind = "pairs"

    @property
    def crouched(self) -> float:
        """How often people bend their knees more than those who were captured; never where networks are measured."""
        return CROUCHED if self.split == "train" else 0.0

    def identity(self) -> str:
        """Digest of the code, networks, motions and seed that decide a window."""
        return identity_of(
            {
                "code": code_digest(MODULES[self.kind]).modules,
                "networks": [manifest()[name].sha256 for name in NETWORKS[self.kind]],
                "packs": [hashlib.sha256(pack.read_bytes()).hexdigest() for pack in self.packs],
                "seed": SEEDS[self.kind][self.split],
                "crouched": self.crouched,
            }
        )

    def groups(self) -> list[tuple[str, range]]:
        """Name and numbers of each group."""
        starts = range(0, self.count, GROUP)
        return [(f"{self.split}-{k:05d}", range(s, min(s + GROUP, self.count))) for k, s in enumerate(starts)]


@flow(name="build-pairs", persist_result=False)
def build_pairs(
    split: Split, count: int, out: Path, packs: tuple[Path, ...] = (), threads: int = 2, kind: Kind = "pairs"
) -> Path:
    """Make all windows that the folder lacks; returns the folder."""
    plan = PairPlan(split, count, packs or shipped_packs("places", split), kind)
    pair_set = PairSet(out, plan.identity())
    out.mkdir(parents=True, exist_ok=True)
    missing = [(name, numbers) for name, numbers in plan.groups() if not pair_set.has(name)]
    log.info("%s: %d of %d groups are to be made", out, len(missing), len(plan.groups()))
    calls = [(plan, pair_set, name, numbers) for name, numbers in missing]
    for done, name in enumerate(made_in_processes(make_group, calls, threads), start=1):
        log.info("%s: %d of %d groups", name, done, len(missing))
    return out


def make_group(plan: PairPlan, pair_set: PairSet, name: str, numbers: range) -> str:
    """Render and look at the windows of one group; returns its name. Runs in a process of its own."""
    prepare_process()
    sequences: list[MocapSequence] = [sequence for pack in plan.packs for sequence in read_pack(pack)]
    source = PairSource(Library(takes_of(sequences, plan.split)), SEEDS[plan.kind][plan.split], plan.crouched)
    draw = source.window if plan.kind == "pairs" else LookSource(source).looks
    windows, facts = zip(*(draw(number) for number in numbers), strict=True)
    packed = [window.packed() for window in windows]
    pair_set.write(name, {key: np.stack([one[key] for one in packed]) for key in packed[0]}, list(facts))
    return name
