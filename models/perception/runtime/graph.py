"""A network in TensorFlow Lite's format as a torch module, because LiteRT's Python package knows no CUDA device.

It has the operations of the networks that look at one crop. Tensors are in the file's order: batch, height, width,
channels.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
import torch
from ai_edge_litert import schema_py_generated as schema
from torch import Tensor, nn
from torch.nn import functional

Operation = Callable[..., Tensor | tuple[Tensor, ...]]
Numbers = list[int]

_CODES = {number: name for name, number in vars(schema.BuiltinOperator).items() if isinstance(number, int)}
_DTYPES = {
    schema.TensorType.FLOAT32: np.float32,
    schema.TensorType.FLOAT16: np.float16,
    schema.TensorType.INT32: np.int32,
}
_ACTIVATIONS: Mapping[int, Callable[[Tensor], Tensor]] = {
    schema.ActivationFunctionType.NONE: lambda x: x,
    schema.ActivationFunctionType.RELU: functional.relu,
    schema.ActivationFunctionType.RELU6: functional.relu6,
}


class Graph(nn.Module):
    """Computes in float32, also where the file's weights are float16.

    Raises ValueError for a network with an operation that is not among those of this module.
    """

    def __init__(self, model: bytes) -> None:
        super().__init__()
        network = schema.ModelT.InitFromObj(schema.Model.GetRootAsModel(model, 0))
        (graph,) = network.subgraphs
        constants = {
            k: np.frombuffer(bytes(data), _DTYPES[tensor.type]).reshape(() if tensor.shape is None else tensor.shape)
            for k, tensor in enumerate(graph.tensors)
            if (data := network.buffers[tensor.buffer].data) is not None
        }
        self._steps: list[tuple[Operation, Numbers, Numbers]] = []
        for operator in graph.operators:
            code = network.operatorCodes[operator.opcodeIndex]
            name = _CODES[max(code.builtinCode, code.deprecatedBuiltinCode)]
            given, made = list(operator.inputs), list(operator.outputs)
            if name == "DEQUANTIZE" and given[0] in constants:
                constants[made[0]] = constants[given[0]].astype(np.float32)
            elif name in _WITH_OPTIONS:
                self._steps.append((partial(_WITH_OPTIONS[name], o=operator.builtinOptions), given, made))
            elif name in _WITH_NUMBERS:
                numbers = constants[given[1]].ravel().tolist()
                self._steps.append((partial(_WITH_NUMBERS[name], numbers=numbers), given[:1], made))
            elif name in _PLAIN:
                self._steps.append((_PLAIN[name], given, made))
            else:
                raise ValueError(f"a network has the operation {name}, which this module does not know")
        used = {k for _, given, _ in self._steps for k in given}
        self._constants = sorted(used & set(constants))
        for k in self._constants:
            self.register_buffer(f"constant_{k}", torch.from_numpy(constants[k].copy()), persistent=False)
        (self._input,) = graph.inputs
        self._outputs = {graph.tensors[k].name.decode(): k for k in graph.outputs}

    def forward(self, tensor: Tensor) -> dict[str, Tensor]:
        """Outputs by name."""
        values = {k: self.get_buffer(f"constant_{k}") for k in self._constants}
        values[self._input] = tensor
        for operation, given, made in self._steps:
            results = operation(*(values[k] for k in given))
            values.update(zip(made, results if isinstance(results, tuple) else (results,), strict=True))
        return {name: values[k] for name, k in self._outputs.items()}


def _channels_first(x: Tensor) -> Tensor:
    return x.permute(0, 3, 1, 2)


def _channels_last(x: Tensor) -> Tensor:
    return x.permute(0, 2, 3, 1)


def _padded(x: Tensor, size: tuple[int, int], o: Any, value: float = 0.0) -> Tensor:
    """A picture (b,c,h,w) with what the padding "same" adds for a window of that size (height, width): where the number
    is odd one more below and right."""
    if o.padding != schema.Padding.SAME:
        return x
    sides = []
    for length, window, stride in ((x.shape[3], size[1], o.strideW), (x.shape[2], size[0], o.strideH)):
        missing = max((-(-length // stride) - 1) * stride + window - length, 0)
        sides += [missing // 2, missing - missing // 2]
    return functional.pad(x, sides, value=value) if any(sides) else x


def _convolution(x: Tensor, weights: Tensor, bias: Tensor, *, o: Any) -> Tensor:
    """Weights are (out, height, width, in)."""
    return _convolved(x, weights.permute(0, 3, 1, 2), bias, o, groups=1)


def _depthwise_convolution(x: Tensor, weights: Tensor, bias: Tensor, *, o: Any) -> Tensor:
    """Weights are (1, height, width, out)."""
    return _convolved(x, weights.permute(3, 0, 1, 2), bias, o, groups=x.shape[3])


def _convolved(x: Tensor, weights: Tensor, bias: Tensor, o: Any, *, groups: int) -> Tensor:
    dilation = o.dilationHFactor, o.dilationWFactor
    height, width = (d * (k - 1) + 1 for d, k in zip(dilation, weights.shape[2:], strict=True))
    padded = _padded(_channels_first(x), (height, width), o)
    y = functional.conv2d(padded, weights, bias, (o.strideH, o.strideW), 0, dilation, groups)
    return _channels_last(_ACTIVATIONS[o.fusedActivationFunction](y))


def _max_pool(x: Tensor, *, o: Any) -> Tensor:
    window = o.filterHeight, o.filterWidth
    padded = _padded(_channels_first(x), window, o, value=-torch.inf)
    return _channels_last(functional.max_pool2d(padded, window, (o.strideH, o.strideW)))


def _arithmetic(operation: Callable[[Tensor, Tensor], Tensor], a: Tensor, b: Tensor, *, o: Any) -> Tensor:
    return _ACTIVATIONS[o.fusedActivationFunction](operation(a, b))


def _fully_connected(x: Tensor, weights: Tensor, bias: Tensor, *, o: Any) -> Tensor:
    return _ACTIVATIONS[o.fusedActivationFunction](functional.linear(x, weights, bias))


def _resized(x: Tensor, *, numbers: Numbers) -> Tensor:
    """Bilinear, with pixel centres at halves; all of our networks' are."""
    return _channels_last(functional.interpolate(_channels_first(x), numbers, mode="bilinear", align_corners=False))


def _with_margins(x: Tensor, *, numbers: Numbers) -> Tensor:
    """Margins (before, after) of each axis, the first axis first; torch takes the last axis first."""
    pairs = [numbers[k : k + 2] for k in range(0, len(numbers), 2)]
    return functional.pad(x, [side for pair in reversed(pairs) for side in pair])


_WITH_OPTIONS: Mapping[str, Operation] = {
    "CONV_2D": _convolution,
    "DEPTHWISE_CONV_2D": _depthwise_convolution,
    "FULLY_CONNECTED": _fully_connected,
    "MAX_POOL_2D": _max_pool,
    "ADD": partial(_arithmetic, torch.add),
    "SUB": partial(_arithmetic, torch.sub),
    "MUL": partial(_arithmetic, torch.mul),
    "DIV": partial(_arithmetic, torch.div),
    "CONCATENATION": lambda *tensors, o: torch.cat(tensors, o.axis),
    "PACK": lambda *tensors, o: torch.stack(tensors, o.axis),
    "UNPACK": lambda x, o: torch.unbind(x, o.axis),
}
"""By the options that stand in the file."""
_WITH_NUMBERS: Mapping[str, Operation] = {
    "PAD": _with_margins,
    "RESHAPE": lambda x, numbers: x.reshape(numbers),
    "RESIZE_BILINEAR": _resized,
    "ARG_MAX": lambda x, numbers: torch.argmax(x, numbers[0]).to(torch.int32),
    "MEAN": lambda x, numbers: torch.mean(x, numbers),
}
"""By a constant that torch wants as numbers: a shape, or axes."""
_PLAIN: Mapping[str, Operation] = {
    "CAST": lambda x: x.to(torch.float32),
    "LOGISTIC": torch.sigmoid,
    "SQRT": torch.sqrt,
    "SQUARED_DIFFERENCE": lambda a, b: (a - b) ** 2,
    "FLOOR_DIV": lambda a, b: torch.div(a, b, rounding_mode="floor"),
    "GATHER_ND": lambda x, index: x[tuple(index.long().unbind(-1))],
}
