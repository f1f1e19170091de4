"""One video of a data set with its truth, before it is written as a benchmark's pair of files."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float


@dataclass(frozen=True)
class ImageRecording:
    """F pictures in order, one camera, its people; world z up, metres, pixel centres at .5."""

    name: str
    fps: float
    pictures: tuple[Path, ...]
    joint_names: tuple[str, ...]
    people: tuple[Float[np.ndarray, "F J 3"], ...]
    observed: tuple[Bool[np.ndarray, "F"], ...]
    K: Float[np.ndarray, "3 3"]
    R_world_cam: Float[np.ndarray, "F 3 3"]
    t_world_cam: Float[np.ndarray, "F 3"]
