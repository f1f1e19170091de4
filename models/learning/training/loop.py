"""The training of a network: AdamW, Muon for matrices of hidden layers, one cosine of the rate, the mean of the last
weights; resumes where it stopped."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
import torch
from torch import Tensor, nn

from humanmm.models.learning.training.muon import Muon

Net = TypeVar("Net", bound=nn.Module)


@dataclass(frozen=True)
class Recipe:
    """Everything that decides the weights, besides the data."""

    steps: int
    batch: int = 24
    rate: float = 8e-4
    warm_up: int = 200
    weight_decay: float = 0.05
    averaged: float = 0.998
    """Of the weights delivered, what each step leaves of those before."""
    seed: int = 0
    patience: int = 8
    """Validations in a row without a better error that end a training."""


class Training(Generic[Net]):
    """The state of a training; `state` and `restore` carry it over the end of a process."""

    def __init__(
        self,
        recipe: Recipe,
        build: Callable[[], Net],
        loss: Callable[[Net, np.random.Generator, torch.Generator], Tensor],
        *,
        hidden: Callable[[Net], Iterable[nn.Parameter]] = lambda _: (),
        device: str = "cpu",
    ) -> None:
        """`loss` draws a batch, from these two generators alone, and measures a network on it; `hidden`: the matrices
        of a network that Muon trains, in place of AdamW."""
        torch.manual_seed(recipe.seed)
        self.recipe, self._build, self._loss, self._device = recipe, build, loss, device
        self.network = build().to(device)
        self.optimisers = _optimisers(self.network, list(hidden(self.network)), recipe)
        self.averaged = {name: value.clone() for name, value in self.network.state_dict().items()}
        self.generator = torch.Generator().manual_seed(recipe.seed + 1)
        self.rng = np.random.default_rng(recipe.seed + 2)
        self.step = 0
        self.losses: list[float] = []
        """Mean loss of each hundred steps."""
        self._recent: list[float] = []

    def run(self, steps: int, progress: Callable[[int, int], None]) -> None:
        """So many steps more, or to the end."""
        for _ in range(min(steps, self.recipe.steps - self.step)):
            self._one_step()
            progress(self.step, self.recipe.steps)

    def _one_step(self) -> None:
        recipe = self.recipe
        warm = min(1.0, (self.step + 1) / recipe.warm_up)
        rate = recipe.rate * warm * (0.5 * (1 + math.cos(math.pi * self.step / recipe.steps)) + 0.01)
        value = self._loss(self.network, self.rng, self.generator)
        self.network.zero_grad()
        value.backward()  # type: ignore[no-untyped-call]
        nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)
        for optimiser in self.optimisers:
            for group in optimiser.param_groups:
                group["lr"] = rate
            optimiser.step()
        self.step += 1
        keep = min(recipe.averaged, (1 + self.step) / (10 + self.step))
        with torch.no_grad():
            for name, weights in self.network.state_dict().items():
                self.averaged[name].lerp_(weights, 1 - keep)
        self._recent.append(float(value.detach()))
        if len(self._recent) == 100:
            self.losses.append(float(np.mean(self._recent)))
            self._recent.clear()

    def with_weights(self, weights: Mapping[str, Tensor]) -> Net:
        """The network with other weights, as it would be delivered: `averaged` are those of now."""
        network = self._build()
        network.load_state_dict({name: value.cpu() for name, value in weights.items()})
        return network.eval()

    def state(self) -> dict[str, Any]:
        """All that the next step depends on: tensors, numbers and strings."""
        return {
            "network": self.network.state_dict(), "averaged": self.averaged,
            "optimisers": [optimiser.state_dict() for optimiser in self.optimisers],
            "generator": self.generator.get_state(), "dropout": torch.get_rng_state(),
            "rng": self.rng.bit_generator.state, "step": self.step, "losses": self.losses, "recent": self._recent,
        }  # fmt: skip

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on where a state was taken; the next weights are the same bytes."""
        self.network.load_state_dict(state["network"])
        for optimiser, own in zip(self.optimisers, state["optimisers"], strict=True):
            optimiser.load_state_dict(own)
        self.averaged = {name: value.to(self._device) for name, value in state["averaged"].items()}
        self.generator.set_state(state["generator"])
        torch.set_rng_state(state["dropout"])
        self.rng.bit_generator.state = state["rng"]
        self.step, self.losses, self._recent = state["step"], list(state["losses"]), list(state["recent"])


def _optimisers(network: nn.Module, hidden: list[nn.Parameter], recipe: Recipe) -> list[torch.optim.Optimizer]:
    """Of all parameters of a network, and of those of its hidden matrices."""
    are_hidden = {id(matrix) for matrix in hidden}
    others = [parameter for parameter in network.parameters() if id(parameter) not in are_hidden]
    adam = torch.optim.AdamW(others, recipe.rate, weight_decay=recipe.weight_decay, betas=(0.9, 0.98), fused=True)
    return [adam, Muon(hidden, recipe.rate, weight_decay=recipe.weight_decay)] if hidden else [adam]
