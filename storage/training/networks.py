"""Networks that trainings deliver."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeVar

import torch
from safetensors import SafetensorError
from safetensors.torch import load, save_file

from humanmm.errors import InputError
from humanmm.models.weights.eight_bits import packed, unpacked
from humanmm.storage.store.files import replace_file

Net = TypeVar("Net", bound=torch.nn.Module)


def write_network(path: Path, network: torch.nn.Module) -> None:
    """Its numbers as safetensors, matrices in eight bits (`weights.eight_bits`)."""
    replace_file(path, lambda fresh: save_file(packed(network.state_dict()), fresh))


def read_network(path: Path, shaped_as: Callable[[Mapping[str, torch.Tensor]], Net]) -> Net:
    """The network with the numbers of a file that `write_network` wrote; `shaped_as` makes an untrained one for them.
    InputError where they do not fit."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path} holds no network: {error}") from None
    return network_of(content, str(path), shaped_as)


def network_of(content: bytes, name: str, shaped_as: Callable[[Mapping[str, torch.Tensor]], Net]) -> Net:
    """The same of a file's content; errors call it by a name."""
    try:
        numbers = unpacked(load(content))
    except (RuntimeError, SafetensorError) as error:
        raise InputError(f"{name} holds no network: {error}") from None
    network = shaped_as(numbers)
    try:
        network.load_state_dict(numbers)
    except RuntimeError as error:
        raise InputError(f"{name} is no {type(network).__name__}: {error}") from None
    return network.eval()
