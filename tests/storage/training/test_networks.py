"""The delivered network."""

from pathlib import Path

import pytest
import torch
from safetensors.torch import load_file

from humanmm.errors import InputError
from humanmm.storage.training.networks import read_network, write_network


def test_a_network_is_written_in_half_precision_and_its_matrices_in_eight_bits(tmp_path: Path) -> None:
    write_network(tmp_path / "n.safetensors", torch.nn.Linear(64, 2))
    stored = {name: (value.dtype, tuple(value.shape)) for name, value in load_file(tmp_path / "n.safetensors").items()}
    of_weight = {"weight": (torch.int8, (2, 64)), "weight.scale": (torch.float16, (2, 2))}
    assert stored == of_weight | {"bias": (torch.float16, (2,))}


def test_a_network_comes_back_and_another_is_refused(tmp_path: Path) -> None:
    torch.manual_seed(0)
    network = torch.nn.Linear(3, 2)
    write_network(tmp_path / "n.safetensors", network)
    again = read_network(tmp_path / "n.safetensors", lambda _: torch.nn.Linear(3, 2))
    torch.testing.assert_close(again.weight, network.weight, atol=1e-3, rtol=0)
    with pytest.raises(InputError, match="is no Linear"):
        read_network(tmp_path / "n.safetensors", lambda _: torch.nn.Linear(4, 2))
    with pytest.raises(InputError, match=r"none\.safetensors holds no network"):
        read_network(tmp_path / "none.safetensors", lambda _: torch.nn.Linear(3, 2))
