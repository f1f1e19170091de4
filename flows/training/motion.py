"""The trainings of ms-HMR, trajectory predictor and trajectory refiner as flows; each builds on the one before."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from prefect import flow
from torch import nn

from humanmm.flows.bench.render_set import Split
from humanmm.flows.training.card import pose_card, trajectory_card
from humanmm.flows.training.course import train_to_end
from humanmm.flows.training.fits import fitted_pairs
from humanmm.flows.training.sequences import sequences_of
from humanmm.models.learning.motion_clips import ClipSource, MotionClips, error_windows, motion_takes
from humanmm.models.learning.other_motion import ROUTINES
from humanmm.models.learning.training.motion import (
    MotionRecipe,
    corrected,
    ms_hmr_training,
    predictor_training,
    refiner_training,
)
from humanmm.models.learning.training.motion_objective import pose_score, trajectory_score
from humanmm.models.motion.networks.integrate import load_predictor
from humanmm.models.motion.networks.ms_hmr import MsHmr
from humanmm.models.motion.networks.trajectory import TrajectoryPredictor, TrajectoryRefiner
from humanmm.storage.store.files import replace_text
from humanmm.storage.training.networks import read_network, write_network
from humanmm.tasks.units.process import prepare_process

WHOLE_WINDOWS = 0.5
DEV_CLIPS, DEV_SEED = 192, 5
AS_FITTED = "as the fits have it"


@dataclass(frozen=True)
class Material:
    """What clips are made of."""

    pairs: Path
    """The folder of the pairs of the splits train and dev; their fits are kept in it."""
    packs: tuple[Path, ...] = ()
    """Motion capture for training; none: the packs of the repository."""
    threads: int = 2


@flow(name="train-ms-hmr", persist_result=False)
def train_ms_hmr(material: Material, out: Path, recipe: MotionRecipe | None = None, device: str = "cpu") -> Path:
    """Train ms-HMR on the split train of the pairs, measure on dev; returns the network's file."""
    prepare_process()
    recipe = recipe or MotionRecipe()
    source, dev = _sources(material, recipe)

    def measured(network: MsHmr) -> Mapping[str, float]:
        found = pose_score(network, dev)
        return {"MPJPE about the pelvis, mm": found.mpjpe_mm[0], "root, °": found.root_deg[0]}

    network = train_to_end(ms_hmr_training(recipe, source, device=device), out, measured)
    rows = {AS_FITTED: pose_score(None, dev), "ms-HMR": pose_score(network, dev)}
    return _delivered(out, "ms_hmr", network, pose_card(recipe, _data(source, dev), rows))


@flow(name="train-trajectory", persist_result=False)
def train_trajectory(
    material: Material, out: Path, ms_hmr: Path | None = None, recipe: MotionRecipe | None = None, device: str = "cpu"
) -> Path:
    """Train the trajectory predictor; returns the network's file.

    `ms_hmr`: file of the network that corrects poses before; None: poses are as they are fitted.
    """
    prepare_process()
    recipe = recipe or MotionRecipe()
    source, dev = _sources(material, recipe)
    corrector = _ms_hmr(ms_hmr)
    dev = [corrected(clips, corrector) for clips in dev]

    def measured(network: TrajectoryPredictor) -> Mapping[str, float]:
        return _figures(trajectory_score(network, None, dev).velocity_ms[0])

    network = train_to_end(predictor_training(recipe, source, corrector, device=device), out, measured)
    rows = {AS_FITTED: trajectory_score(None, None, dev), "predictor": trajectory_score(network, None, dev)}
    return _delivered(out, "trajectory_predictor", network, trajectory_card(recipe, _data(source, dev), rows))


@flow(name="train-refiner", persist_result=False)
def train_refiner(
    material: Material,
    out: Path,
    ms_hmr: Path | None = None,
    predictor: Path | None = None,
    recipe: MotionRecipe | None = None,
    device: str = "cpu",
) -> Path:
    """Train the trajectory refiner on what the predictor says; returns the network's file.

    `predictor`: its file; None: the shipped one. `ms_hmr` as in `train_trajectory`.
    """
    prepare_process()
    recipe = recipe or MotionRecipe()
    source, dev = _sources(material, recipe)
    corrector = _ms_hmr(ms_hmr)
    before = read_network(predictor, lambda _: TrajectoryPredictor()) if predictor else load_predictor()
    dev = [corrected(clips, corrector) for clips in dev]

    def measured(network: TrajectoryRefiner) -> Mapping[str, float]:
        return _figures(trajectory_score(before, network, dev).velocity_ms[0])

    network = train_to_end(refiner_training(recipe, source, before, corrector, device=device), out, measured)
    rows = {
        AS_FITTED: trajectory_score(None, None, dev),
        "predictor": trajectory_score(before, None, dev),
        "refiner": trajectory_score(before, network, dev),
    }
    return _delivered(out, "trajectory_refiner", network, trajectory_card(recipe, _data(source, dev), rows))


def _ms_hmr(path: Path | None) -> MsHmr | None:
    return read_network(path, lambda _: MsHmr()) if path else None


def _figures(velocity_ms: float) -> Mapping[str, float]:
    return {"velocity of the root, m/s": velocity_ms}


def _sources(material: Material, recipe: MotionRecipe) -> tuple[ClipSource, list[MotionClips]]:
    """Where clips of the split train come from, and clips of dev."""

    def source(split: Split) -> ClipSource:
        sequences = sequences_of(material.packs, split)
        takes = motion_takes(sequences, np.random.default_rng((recipe.seed, len(split))), routines=ROUTINES)
        windows = error_windows(fitted_pairs(material.pairs, split, material.threads))
        return ClipSource(takes, windows, whole=WHOLE_WINDOWS, varied=split == "train")

    dev, rng = source("dev"), np.random.default_rng(DEV_SEED)
    return source("train"), [dev.draw(32, rng) for _ in range(DEV_CLIPS // 32)]


def _data(source: ClipSource, dev: list[MotionClips]) -> str:
    clips = sum(len(one.exists) for one in dev)
    return f"{source.summary}, measured on {clips} clips of other subjects with the errors of other windows"


def _delivered(out: Path, name: str, network: nn.Module, card: str) -> Path:
    path = out / f"{name}.safetensors"
    write_network(path, network)
    replace_text(out / f"{name}.md", card)
    return path
