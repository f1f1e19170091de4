"""The training of the keypoint refiner, and what its errors are."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from humanmm.errors import InputError
from humanmm.models.learning.training.half import half_precision
from humanmm.models.learning.training.loop import Recipe, Training
from humanmm.models.perception.blazepose import LANDMARK_SIDE
from humanmm.models.perception.keypoints.network import SIGMA_PX, KeypointRefiner, RefinerInput
from humanmm.models.perception.keypoints.surroundings import COUNT, HANDS, LIMB_ROWS

Array = np.ndarray

SMALL_PX = 0.8
"""An error of which half hardly matters, pixels of the crop."""
LOST_PX = 48.0
"""An error beyond which a landmark counts no more: it is somewhere else."""
MEASURED_AT_ONCE = 256


@dataclass(frozen=True)
class RefinerRecipe(Recipe):
    """See `Recipe`."""

    steps: int = 9_000
    batch: int = 64
    rate: float = 2e-3
    dropout: float = 0.05


@dataclass(frozen=True, eq=False)
class Looks:
    """All looks of a split; see `learning.landmark_looks`. Windows stay in half precision until they are used."""

    windows: Array
    coarse: Array
    numbers: Array
    shift: Array
    is_known: Array

    @classmethod
    def of(cls, arrays: Mapping[str, Array]) -> "Looks":
        """From a set's arrays, (shots, looks, …). InputError where they are others, of pairs say."""
        missing = [name for name in cls.__annotations__ if name not in arrays]
        if missing:
            raise InputError(f"the set holds no looks ({', '.join(missing)} missing); humanmm train looks makes them")
        return cls(**{name: arrays[name].reshape(-1, *arrays[name].shape[2:]) for name in cls.__annotations__})

    def __len__(self) -> int:
        return len(self.windows)

    def given(self, rows: Array | slice) -> RefinerInput:
        """What the network sees."""
        parts = (self.windows[rows], self.coarse[rows], self.numbers[rows])
        return RefinerInput(*(torch.from_numpy(part).float() for part in parts))

    def units(self) -> tuple[Tensor, Tensor]:
        """How large a channel of the windows and of the coarse cells is: its root mean square."""
        some = slice(None, None, max(1, len(self) // 500))
        parts = (self.windows[some].astype(np.float32), self.coarse[some].astype(np.float32))
        rms = [np.sqrt((part**2).mean(axis=tuple(range(part.ndim - 1)))) for part in parts]
        windows, coarse = (torch.from_numpy(np.maximum(part, 1e-3).astype(np.float32)) for part in rms)
        return windows, coarse


def refiner_training(recipe: RefinerRecipe, looks: Looks, *, device: str = "cpu") -> Training[KeypointRefiner]:
    """A training at its first step."""
    units = looks.units()

    def build() -> KeypointRefiner:
        network = KeypointRefiner(dropout=recipe.dropout)
        with torch.no_grad():
            network.unit.copy_(units[0])
            network.coarse_unit.copy_(units[1])
        return network

    def batch_loss(network: KeypointRefiner, rng: np.random.Generator, _: torch.Generator) -> Tensor:
        rows = np.sort(rng.choice(len(looks), min(recipe.batch, len(looks)), replace=False))
        with half_precision(device):
            shift, sigma = network(RefinerInput(*(part.to(device) for part in looks.given(rows))))
        wanted = torch.from_numpy(looks.shift[rows]).to(device).float()
        return loss(shift.float(), sigma.float(), wanted, torch.from_numpy(looks.is_known[rows]).to(device))

    return Training(recipe, build, batch_loss, device=device)


def loss(shift: Tensor, sigma: Tensor, wanted: Tensor, is_known: Tensor) -> Tensor:
    """The negative logarithm of the likelihood of the errors, Laplace's, and half their size, so that a landmark that
    is hard to see is learnt too; limbs count twice, hands half."""
    weight = torch.ones(COUNT, device=shift.device)
    weight[list(LIMB_ROWS)], weight[list(HANDS)] = 2.0, 0.5
    error = torch.sqrt(((shift - wanted) ** 2).sum(dim=-1) + SMALL_PX**2) / SIGMA_PX
    spread = sigma / SIGMA_PX
    each = error / spread + torch.log(spread) + 0.5 * error.clamp(max=LOST_PX / SIGMA_PX)
    return (each * weight)[is_known].mean()


@dataclass(frozen=True)
class RefinerScore:
    """Errors, % of the crop's side: median and mean (those above 8 count as 8)."""

    limbs: tuple[float, float]
    feet: tuple[float, float]
    hands: tuple[float, float]


def refiner_score(network: KeypointRefiner | None, looks: Looks) -> RefinerScore:
    """Of a network; None: of the keypoints as they are fused."""
    errors = np.concatenate([
        _errors(network, looks, slice(first, first + MEASURED_AT_ONCE))
        for first in range(0, len(looks), MEASURED_AT_ONCE)
    ])  # fmt: skip
    parts = []
    for rows in (LIMB_ROWS, range(LIMB_ROWS.stop, HANDS.start), HANDS):
        own = errors[:, list(rows)][looks.is_known[:, list(rows)]]
        parts.append((float(np.median(own)), float(np.minimum(own, 8).mean())))
    return RefinerScore(*parts)


def _errors(network: KeypointRefiner | None, looks: Looks, rows: slice) -> Array:
    left = looks.shift[rows].astype(np.float32)
    if network is not None:
        with torch.inference_mode():
            left = left - network(looks.given(rows))[0].numpy()
    return np.asarray(100 * np.linalg.norm(left, axis=-1) / LANDMARK_SIDE)
