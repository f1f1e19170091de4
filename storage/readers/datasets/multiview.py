"""One performance filmed by several standing cameras at the same time: what multi-shot videos are cut from."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class MultiviewSequence:
    """F frames, C cameras that stand; world z up, metres, pixel centres at .5; lens distortion is not modelled."""

    name: str
    fps: float
    joint_names: tuple[str, ...]
    joints: Float[np.ndarray, "F J 3"]
    """NaN where a joint is not known."""
    K: Float[np.ndarray, "C 3 3"]
    R_world_cam: Float[np.ndarray, "C 3 3"]
    t_world_cam: Float[np.ndarray, "C 3"]
    videos: tuple[Path, ...]
    """One a camera, in step with the joints."""

    @property
    def num_frames(self) -> int:
        return len(self.joints)
