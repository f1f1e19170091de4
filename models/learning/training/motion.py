"""The trainings of ms-HMR, trajectory predictor and trajectory refiner; each builds on the one before."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from humanmm.models.learning.motion_clips import ClipSource, MotionClips
from humanmm.models.learning.training.loop import Recipe, Training
from humanmm.models.learning.training.motion_objective import pose_loss, trajectory_loss
from humanmm.models.motion.networks.ms_hmr import MsHmr
from humanmm.models.motion.networks.trajectory import TrajectoryPredictor, TrajectoryRefiner

TRUE_POSES = 0.3
"""Fraction of batches in which the predictor is shown true poses: what limbs say of paths is learnt from these."""


@dataclass(frozen=True)
class MotionRecipe(Recipe):
    """See `Recipe`."""

    steps: int = 3_000
    batch: int = 16


def ms_hmr_training(recipe: MotionRecipe, source: ClipSource, *, device: str = "cpu") -> Training[MsHmr]:
    """A training of ms-HMR at its first step."""

    def batch_loss(network: MsHmr, rng: np.random.Generator, _: torch.Generator) -> Tensor:
        clips = source.draw(recipe.batch, rng).to(device)
        return pose_loss(network(clips.given), clips)

    return Training(recipe, MsHmr, batch_loss, device=device)


def predictor_training(
    recipe: MotionRecipe, source: ClipSource, ms_hmr: MsHmr | None = None, *, device: str = "cpu"
) -> Training[TrajectoryPredictor]:
    """A training of the trajectory predictor, on poses as they are fitted or as ms-HMR has corrected them."""

    def batch_loss(network: TrajectoryPredictor, rng: np.random.Generator, _: torch.Generator) -> Tensor:
        clips = source.draw(recipe.batch, rng).to(device)
        clips = replace(clips, given=clips.true) if rng.random() < TRUE_POSES else corrected(clips, ms_hmr)
        return trajectory_loss(network(clips.given), clips)

    return Training(recipe, TrajectoryPredictor, batch_loss, device=device)


def refiner_training(
    recipe: MotionRecipe,
    source: ClipSource,
    predictor: TrajectoryPredictor,
    ms_hmr: MsHmr | None = None,
    *,
    device: str = "cpu",
) -> Training[TrajectoryRefiner]:
    """A training of the trajectory refiner, on what both say."""
    predictor = predictor.to(device).eval()

    def batch_loss(network: TrajectoryRefiner, rng: np.random.Generator, _: torch.Generator) -> Tensor:
        clips = corrected(source.draw(recipe.batch, rng).to(device), ms_hmr)
        with torch.no_grad():
            predicted = predictor(clips.given)
        return trajectory_loss(network(clips.given, predicted), clips)

    return Training(recipe, TrajectoryRefiner, batch_loss, device=device)


def corrected(clips: MotionClips, ms_hmr: MsHmr | None) -> MotionClips:
    """The clips with their poses as ms-HMR has them, or as they are."""
    if ms_hmr is None:
        return clips
    ms_hmr = ms_hmr.to(clips.contacts.device).eval()
    with torch.no_grad():
        rotations = ms_hmr(clips.given).rotations
    return replace(clips, given=replace(clips.given, rotations=rotations))
