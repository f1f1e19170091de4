"""Half precision where it is quick."""

import pytest
import torch

from humanmm.models.learning.training import half
from humanmm.models.learning.training.half import half_precision, is_quick_in_half
from humanmm.models.perception.lifting.network import LifterInput, LifterNetwork
from humanmm.models.records.landmarks import NUM_LANDMARKS


def test_a_device_is_quick_where_it_has_the_instructions(monkeypatch: pytest.MonkeyPatch) -> None:
    for has in (True, False):
        monkeypatch.setattr(torch.cuda, "is_bf16_supported", lambda has=has, **_: has)
        assert is_quick_in_half("cuda:0") == has
    for able in ({}, {"avx512_bf16": False}, {"avx512_bf16": True}, {"amx_bf16": True}):
        monkeypatch.setattr(torch.cpu, "get_capabilities", able.copy)
        assert is_quick_in_half("cpu") == any(able.values())


@pytest.mark.parametrize("is_quick", [True, False])
def test_products_inside_are_in_half_precision_and_nothing_after(
    is_quick: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(half, "is_quick_in_half", lambda _: is_quick)
    a = torch.ones(2, 2)
    with half_precision("cpu"):
        assert (a @ a).dtype == (torch.bfloat16 if is_quick else torch.float32)
    assert (a @ a).dtype == torch.float32


def test_a_lifter_says_nearly_the_same_and_in_full_precision(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(half, "is_quick_in_half", lambda _: True)
    torch.manual_seed(0)
    network = LifterNetwork(depth=2)
    torch.nn.init.normal_(network.outward.weight, std=0.05)
    n = 6
    given = LifterInput(
        time_s=torch.arange(n)[None] / 30.0, exists=torch.ones(1, n, dtype=torch.bool),
        points=torch.randn(1, n, NUM_LANDMARKS, 2), certainty=torch.rand(1, n, NUM_LANDMARKS),
        landmarks=torch.randn(1, n, NUM_LANDMARKS, 3), has_landmarks=torch.ones(1, n, dtype=torch.bool),
        size=torch.ones(1, n),
    )  # fmt: skip
    whole = network(given).landmarks
    with half_precision("cpu"):
        found = network(given).landmarks
    assert found.dtype == torch.float32
    off = (found - whole).abs().max().item()
    assert 0 < off < 0.02, "it multiplied in another precision, and that changes little"
