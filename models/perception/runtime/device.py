"""Networks on a torch device."""

from threading import Lock

import numpy as np
import torch

from humanmm.models.perception.runtime.graph import Graph

CUDA = "cuda"


def is_there() -> bool:
    """Whether torch can compute on a CUDA device."""
    return torch.cuda.is_available()


class DeviceNetwork:
    """One network on a torch device, in float32, one inference at a time; equal inputs give equal bytes."""

    def __init__(self, model: bytes, device: str) -> None:
        torch.backends.cudnn.allow_tf32 = False  # a mantissa of ten bits
        torch.backends.cudnn.deterministic = True
        self._device = torch.device(device)
        self._graph = Graph(model).to(self._device).eval()
        self._alone = Lock()

    def run(self, tensor: np.ndarray, wanted: tuple[str, ...] = ()) -> list[np.ndarray]:
        """See `Network`."""
        with self._alone, torch.inference_mode():
            outputs = self._graph(torch.from_numpy(tensor).to(self._device))
            return [outputs[name].cpu().numpy() for name in wanted or outputs]
