"""What the shipped keypoint refiner says of a look."""

from functools import lru_cache

import numpy as np
import torch
from jaxtyping import Float

from humanmm.models.perception.keypoints.network import KeypointRefiner, RefinerInput
from humanmm.models.perception.keypoints.surroundings import WEIGHTS, Seen
from humanmm.models.weights.eight_bits import shipped_network

Array = np.ndarray


def refined(seen: Seen) -> tuple[Float[Array, "22 2"], Float[Array, " 22"]]:
    """Shifts of REFINED's landmarks, and the errors to expect after these, pixels of the crop."""
    parts = (seen.windows(), seen.coarse(), seen.numbers())
    with torch.inference_mode():
        shift, sigma = load_refiner()(RefinerInput(*(torch.from_numpy(part)[None] for part in parts)))
    return np.asarray(shift[0].numpy(), np.float64), np.asarray(sigma[0].numpy(), np.float64)


@lru_cache(maxsize=1)
def load_refiner() -> KeypointRefiner:
    """The shipped one, checked against its sha256."""
    return shipped_network(WEIGHTS, KeypointRefiner.shaped_as)
