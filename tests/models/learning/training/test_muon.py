"""Muon's steps."""

import pytest
import torch
from torch import nn

from humanmm.models.learning.training.muon import RMS, Muon, orthogonal


@pytest.mark.parametrize("shape", [(24, 60), (60, 24), (30, 30)])
def test_singular_values_become_alike(shape: tuple[int, int]) -> None:
    generator = torch.Generator().manual_seed(1)
    u, _, v = torch.linalg.svd(torch.randn(*shape, generator=generator), full_matrices=False)
    values = torch.logspace(0, -1.5, min(shape))
    found = orthogonal(u @ torch.diag(values) @ v)
    assert found.shape == shape
    along = torch.diag(u.T @ found @ v.T)
    assert float(along.min()) > 0.6 and float(along.max()) < 1.3
    assert torch.allclose(found, u @ torch.diag(along) @ v, atol=1e-4)


def test_a_step_has_the_size_of_the_rate_whatever_the_gradient() -> None:
    matrix = nn.Parameter(torch.zeros(40, 90))
    matrix.grad = 1e-3 * torch.randn(40, 90, generator=torch.Generator().manual_seed(2))
    Muon([matrix], 0.01, weight_decay=0.0).step()
    assert float(matrix.detach().square().mean().sqrt()) == pytest.approx(0.01 * RMS, rel=0.25)
    assert float((matrix * matrix.grad).sum().detach()) < 0


def test_weights_decay_by_the_rate() -> None:
    matrix = nn.Parameter(torch.ones(4, 6))
    matrix.grad = torch.zeros(4, 6)
    Muon([matrix], 0.1, weight_decay=0.5).step()
    assert torch.allclose(matrix.detach(), torch.full((4, 6), 0.95))


def test_it_learns_a_linear_map() -> None:
    generator = torch.Generator().manual_seed(3)
    wanted = torch.randn(8, 8, generator=generator)
    matrix = nn.Parameter(torch.zeros(8, 8))
    optimiser = Muon([matrix], 0.5, weight_decay=0.0)
    for step in range(300):
        optimiser.param_groups[0]["lr"] = 0.5 * (1 - step / 300)
        matrix.grad = None
        ((matrix - wanted) ** 2).sum().backward()
        optimiser.step()
    assert float((matrix - wanted).abs().max().detach()) < 0.1
