"""The trainings of the lifters: of pictures by rendered windows and other motion with their errors, of COCO's keypoints
alone by motion capture."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool
from torch import Tensor

from humanmm.models.learning.keypoint_motion import KeypointMotion
from humanmm.models.learning.other_motion import OtherMotion, with_routines
from humanmm.models.learning.training.half import half_precision
from humanmm.models.learning.training.lifter_objective import loss
from humanmm.models.learning.training.loop import Recipe, Training
from humanmm.models.learning.windows import Variation, Windows, varied
from humanmm.models.perception.lifting.network import LifterInput, LifterNetwork

Array = np.ndarray

LENGTHS = (10, 10, 10, 32)
"""Of windows, frames: a batch shows one of them, and as many windows as have together the frames of a recipe's `batch`
windows of the largest. Frames beside each other say nearly the same: a network learns much faster from many short
windows than from few long ones."""


@dataclass(frozen=True)
class LifterRecipe(Recipe):
    """See `Recipe`."""

    steps: int = 1_500
    rate: float = 1.5e-3
    warm_up: int = 100
    patience: int = 20
    dropout: float = 0.1
    """In every block."""
    other_motion: float = 0.5
    """Fraction of the batches that show other motion than was rendered."""
    coco: tuple[float, float] = (0.15, 0.5)
    """Windows with COCO's keypoints alone: of rendered and of other motion."""
    routines: float = 0.3
    """Fraction of either that shows a routine: there are few among the takes, and nobody captures what they show."""


def lifter_training(
    recipe: LifterRecipe,
    windows: Windows,
    other: OtherMotion,
    *,
    begin_with: LifterNetwork,
    is_routine: Bool[Array, " W"] | None = None,
    device: str = "cpu",
) -> Training[LifterNetwork]:
    """A training at its first step; `begin_with`: a keypoint lifter, say, with whose weights it begins; `is_routine`
    says which windows show a routine."""
    nothing = np.zeros(len(windows), dtype=bool)
    probability = with_routines(np.ones(len(windows)), nothing if is_routine is None else is_routine, recipe.routines)
    weights = torch.from_numpy(probability)

    def build() -> LifterNetwork:
        network = LifterNetwork(depth=len(begin_with.blocks), dropout=recipe.dropout)
        network.load_state_dict(begin_with.state_dict())
        return network

    def batch_loss(network: LifterNetwork, rng: np.random.Generator, generator: torch.Generator) -> Tensor:
        length, count = _drawn(recipe, rng)
        if rng.random() < recipe.other_motion:
            drawn, coco = other.draw(count, rng), recipe.coco[1]
        else:
            index = torch.multinomial(weights, count, replacement=True, generator=generator)
            drawn, coco = windows.chosen(index), recipe.coco[0]
        wanted, given = varied(drawn.part(length, rng), Variation(coco=coco), generator)
        return _loss_on(network, given, wanted, device)

    return Training(recipe, build, batch_loss, hidden=LifterNetwork.hidden_matrices, device=device)


@dataclass(frozen=True)
class KeypointRecipe(Recipe):
    """See `Recipe`."""

    steps: int = 12_000
    rate: float = 3e-3
    dropout: float = 0.0
    depth: int = 10
    """Blocks of the network."""


def keypoint_training(
    recipe: KeypointRecipe, motion: KeypointMotion, *, begin_with: LifterNetwork | None = None, device: str = "cpu"
) -> Training[LifterNetwork]:
    """A training at its first step; `begin_with`: a keypoint lifter with whose weights it begins, made as deep as the
    recipe says if it is not."""
    variation = Variation(
        roll_rad=0.0, points=(0.0, 0.0), landmarks_m=(0.0, 0.0), size=0.3, tempo=0.0, swapped=0.2, hidden=0.0, coco=1.0
    )

    def build() -> LifterNetwork:
        if begin_with is not None:
            return begin_with.deepened(max(recipe.depth, len(begin_with.blocks)))
        network = LifterNetwork(depth=recipe.depth, dropout=recipe.dropout)
        network.forget_landmarks()
        with torch.no_grad():
            network.mean.copy_(motion.draw(256, np.random.default_rng(recipe.seed)).truth.mean(dim=(0, 1)))
        return network

    def batch_loss(network: LifterNetwork, rng: np.random.Generator, generator: torch.Generator) -> Tensor:
        length, count = _drawn(recipe, rng)
        wanted, given = varied(motion.draw(count, rng, length), variation, generator)
        given = replace(given, landmarks=torch.zeros_like(given.landmarks))
        return _loss_on(network, given, wanted, device)

    return Training(recipe, build, batch_loss, hidden=LifterNetwork.hidden_matrices, device=device)


def _loss_on(network: LifterNetwork, given: LifterInput, wanted: Windows, device: str) -> Tensor:
    with half_precision(device):
        found = network(given.to(device))
    return loss(found, wanted.to(device))


def _drawn(recipe: Recipe, rng: np.random.Generator) -> tuple[int, int]:
    """Length and number of the windows of a batch."""
    length = LENGTHS[int(rng.integers(len(LENGTHS)))]
    return length, recipe.batch * max(LENGTHS) // length
