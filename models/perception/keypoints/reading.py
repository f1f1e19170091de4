"""What the shipped keypoint refiner says of a look."""

from functools import lru_cache

import numpy as np
import torch
from jaxtyping import Float
from safetensors.torch import load

from humanmm.models.perception.keypoints.network import KeypointRefiner, RefinerInput
from humanmm.models.perception.keypoints.surroundings import WEIGHTS, Seen
from humanmm.models.weights.eight_bits import unpacked
from humanmm.models.weights.shipped import read_weights

Array = np.ndarray

AXIS = 0.8
"""Of an expected distance, that of each axis: of a normal distribution."""


def refined(seen: Seen) -> tuple[Float[Array, "22 2"], Float[Array, " 22"]]:
    """Shifts of REFINED's landmarks, pixels of the crop, and their expected errors after it, each axis."""
    parts = (seen.windows(), seen.coarse(), seen.numbers())
    with torch.inference_mode():
        shift, sigma = load_refiner()(RefinerInput(*(torch.from_numpy(part)[None] for part in parts)))
    return shift[0].numpy().astype(np.float64), AXIS * sigma[0].numpy().astype(np.float64)


@lru_cache(maxsize=1)
def load_refiner() -> KeypointRefiner:
    """The shipped one, checked against its sha256."""
    numbers = unpacked(load(read_weights(WEIGHTS)))
    network = KeypointRefiner.shaped_as(numbers)
    network.load_state_dict(numbers)
    return network.eval()
