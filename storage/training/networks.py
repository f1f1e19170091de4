"""The network that a training delivers."""

from pathlib import Path

import torch
from safetensors.torch import save_file

from humanmm.storage.store.files import replace_file


def write_network(path: Path, network: torch.nn.Module) -> None:
    """Its numbers in half precision, as safetensors."""
    numbers = {name: value.half().contiguous() for name, value in network.state_dict().items()}
    replace_file(path, lambda fresh: save_file(numbers, fresh))
