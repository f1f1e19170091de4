"""The shipped networks that look at pictures, each where it is fastest: on a CUDA device if there is one, else on the
processor.

On a device runs what looks at one person's crop, of one size, many times a second; MultiPose, which looks at whole
pictures of any shape three times a second, stays on the processor. Before a device is used its outputs for one picture
are compared with the processor's, because no result may depend on where it was computed. `CUDA_VISIBLE_DEVICES=`
(empty) keeps everything on the processor.
"""

import logging
import os
from collections.abc import Mapping
from functools import cache, lru_cache
from threading import Lock
from typing import Protocol

import numpy as np

from humanmm.errors import StageError
from humanmm.machine import num_processors, nvidia_devices
from humanmm.models.perception.runtime.inner import showing
from humanmm.models.perception.runtime.litert import InterpreterPool
from humanmm.models.weights.shipped import read_weights

log = logging.getLogger(__name__)

TOLERANCE = 1e-3
"""Largest difference between device and processor, as a fraction of an output's largest value: a quarter of a
pixel of a crop, 1 mm of a body. Two ways of computing in float32 differ by 1e-5 to 3e-4 (mask)."""
INNER: Mapping[str, Mapping[str, int]] = {
    "pose_landmark_heavy.tflite": {"fine": 545, "coarse": 587},
    "movenet-thunder.tflite": {"features": 399, "heat": 417},
}
"""Tensors inside a network that it gives out as well, by the names that they have as outputs: BlazePose's features from
which its heat maps are made (64 × 64 cells of a crop) and those of 32 × 32 cells beneath its landmarks, Thunder's
features and the logits of its heat maps (64 × 64)."""
_LOADING = Lock()


class Network(Protocol):
    """One network; several threads may run it at the same time."""

    def run(self, tensor: np.ndarray, wanted: tuple[str, ...] = ()) -> list[np.ndarray]:
        """Outputs of one inference by tensor name (a network may have large ones that nobody needs); else all."""
        ...


def network(name: str, shape: tuple[int, ...] | None = None) -> Network:
    """The process's one of that name; `shape` of the input where the network leaves it open.

    Raises StageError if a device computes something else than the processor.
    """
    with _LOADING:
        return _loaded(name, shape)


@lru_cache(maxsize=16)
def _loaded(name: str, shape: tuple[int, ...] | None) -> Network:
    on_processor = InterpreterPool(_weights(name), min(2, num_processors()), shape)
    if shape is not None or not nvidia_devices():
        return on_processor
    from humanmm.models.perception.runtime import device  # imports torch, for which nobody without a device waits

    if not device.is_there():
        _tell_unused()
        return on_processor
    on_device = device.DeviceNetwork(_weights(name), device.CUDA)
    assert_equal(name, on_device, on_processor)
    log.info("%s runs on the CUDA device", name)
    return on_device


@cache
def _tell_unused() -> None:
    """Log, once a process, that a device is there that does nothing, unless that is wished."""
    if os.environ.get("CUDA_VISIBLE_DEVICES") != "":
        log.warning("torch cannot use the NVIDIA device: the networks run on the processor; `humanmm doctor` says why")


def assert_equal(name: str, on_device: Network, on_processor: InterpreterPool) -> None:
    """Raises StageError unless a network's outputs for one picture are equal to within TOLERANCE."""
    picture = on_processor.sample_input()
    for one, other in zip(on_device.run(picture), on_processor.run(picture), strict=True):
        difference = float(np.abs(one - other).max() / max(np.abs(other).max(), np.finfo(np.float32).tiny))
        if not difference <= TOLERANCE:
            raise StageError(
                f"the CUDA device computes {name} otherwise than the processor (outputs differ by {difference:.1%}, "
                f"allowed are {TOLERANCE:.1%}): run with CUDA_VISIBLE_DEVICES= (empty) to do without it, or renew its "
                "driver and torch"
            )


@lru_cache(maxsize=8)
def _weights(name: str) -> bytes:
    """Read and checked once, however many shapes its input takes."""
    return showing(read_weights(name), INNER.get(name, {}))
