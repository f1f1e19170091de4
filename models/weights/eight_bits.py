"""The numbers of our own networks as files hold them: matrices in eight bits, the rest in half precision.

Thirty-two numbers of a row share a scale. That is half the size, and moves what the lifter says of landmarks by 1.6 mm
where it errs by 77; with one scale for a whole row, and the first layer too, it would be 21 mm
(docs/measurements/networks.md).
"""

from collections.abc import Callable, Mapping
from typing import TypeVar

import torch
from safetensors.torch import load
from torch import Tensor, nn

from humanmm.models.weights.shipped import read_weights

Net = TypeVar("Net", bound=nn.Module)

GROUP, LARGEST = 32, 127
SCALE = ".scale"
"""After the name of a matrix: the name of its scales."""


def packed(numbers: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """As files hold them. A matrix whose rows are no whole number of groups, as a first layer's may be, stays in half
    precision: what a network is given has numbers of very different sizes."""
    stored: dict[str, Tensor] = {}
    for name, value in numbers.items():
        if value.ndim != 2 or value.shape[1] % GROUP:
            stored[name] = value.half().contiguous()
            continue
        groups = value.float().reshape(len(value), -1, GROUP)
        scale = (groups.abs().amax(dim=-1) / LARGEST).half()
        steps = torch.nan_to_num(groups / scale.float()[..., None], posinf=LARGEST, neginf=-LARGEST)
        stored[name] = steps.round().clamp(-LARGEST, LARGEST).to(torch.int8).reshape(value.shape)
        stored[name + SCALE] = scale
    return stored


def unpacked(stored: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The numbers, float32, of what `packed` gave."""
    numbers: dict[str, Tensor] = {}
    for name, value in stored.items():
        scale = stored.get(name + SCALE)
        if scale is not None:
            numbers[name] = (value.float().reshape(*scale.shape, GROUP) * scale.float()[..., None]).reshape(value.shape)
        elif not name.endswith(SCALE):
            numbers[name] = value.float()
    return numbers


def shipped_network(name: str, shaped_as: Callable[[Mapping[str, Tensor]], Net]) -> Net:
    """The network with the numbers of a shipped file, checked against its sha256; `shaped_as` makes an untrained one
    for them."""
    numbers = unpacked(load(read_weights(name)))
    network = shaped_as(numbers)
    network.load_state_dict(numbers)
    return network.eval()
