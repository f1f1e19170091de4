"""The delivered network."""

from pathlib import Path

import torch
from safetensors.torch import load_file

from humanmm.storage.training.networks import write_network


def test_a_network_is_written_in_half_precision(tmp_path: Path) -> None:
    write_network(tmp_path / "n.safetensors", torch.nn.Linear(3, 2))
    assert {value.dtype for value in load_file(tmp_path / "n.safetensors").values()} == {torch.float16}
