"""Muon, an optimiser for the matrices of hidden layers: each step is the orthogonal matrix nearest to the momentum.

Jordan et al. 2024, "Muon: an optimizer for hidden layers in neural networks"; the size of a step is that of Liu et al.
2025, "Muon is scalable for LLM training", by which it takes AdamW's rates. `torch.optim.Muon` is the same, but always
multiplies in bfloat16, also on a processor that has to emulate it.
"""

from collections.abc import Iterable

import torch
from jaxtyping import Float
from torch import Tensor, nn

from humanmm.models.learning.training.half import is_quick_in_half

NEWTON_SCHULZ = (3.4445, -4.7750, 2.0315)
"""Coefficients of the quintic that drives singular values towards 1 (Jordan et al.),"""
ITERATIONS = 5
"""and how often it is applied: they lie between 0.7 and 1.2 then."""
RMS = 0.2
"""Root mean square of a step's elements, at a rate of 1: AdamW's, about (Liu et al.)."""


class Muon(torch.optim.Optimizer):
    """Of matrices alone."""

    def __init__(
        self, matrices: Iterable[nn.Parameter], lr: float, *, weight_decay: float, momentum: float = 0.95
    ) -> None:
        super().__init__(matrices, {"lr": lr, "weight_decay": weight_decay, "momentum": momentum})

    @torch.no_grad()
    def step(self, closure: None = None) -> None:  # type: ignore[override]
        """One step down the last gradients, with Nesterov's momentum."""
        for group in self.param_groups:
            lr, keep = group["lr"], group["momentum"]
            in_half = is_quick_in_half(str(group["params"][0].device))
            for matrix in group["params"]:
                state = self.state[matrix]
                if not state:
                    state["momentum"] = torch.zeros_like(matrix)
                momentum = state["momentum"]
                momentum.lerp_(matrix.grad, 1 - keep)
                wanted = matrix.grad.lerp(momentum, keep)
                direction = orthogonal(wanted.bfloat16() if in_half else wanted)
                matrix.mul_(1 - lr * group["weight_decay"])
                matrix.add_(direction, alpha=-lr * RMS * max(matrix.shape) ** 0.5)


def orthogonal(matrix: Float[Tensor, "m n"]) -> Float[Tensor, "m n"]:
    """The matrix with all its singular values near 1; nothing is left of those that are tiny beside the largest."""
    a, b, c = NEWTON_SCHULZ
    is_tall = matrix.shape[0] > matrix.shape[1]
    x = matrix.T if is_tall else matrix
    x = x / (x.norm() + 1e-7)
    for _ in range(ITERATIONS):
        gram = x @ x.T
        x = torch.addmm(x, torch.addmm(gram, gram, gram, beta=b, alpha=c), x, beta=a)
    return x.T if is_tall else x
