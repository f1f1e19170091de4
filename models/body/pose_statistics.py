"""How people hold and move their joints: what weights/pose_prior.npz says (`motion.fit.pose_prior` makes it)."""

import io
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from jaxtyping import Float

from humanmm.models.weights.shipped import read_weights

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class PoseStatistics:
    """Rotation vectors of FREE_JOINTS (57 numbers, radians), and accelerations of a fit's 63 parameters."""

    shares: Float[Array, " C"]
    means: Float[Array, "C 57"]
    covariances: Float[Array, "C 57 57"]
    lower: Float[Array, " 57"]
    upper: Float[Array, " 57"]
    acceleration: Float[Array, " 63"]
    """Root mean square: rad/s², m/s² for the pelvis."""

    @property
    def mean(self) -> Float[Array, " 57"]:
        """Of all poses."""
        return np.asarray(self.means[-1])  # the wide component's

    @cached_property
    def precisions(self) -> Float[Array, "C 57 57"]:
        """Inverse covariances."""
        return np.asarray(np.linalg.inv(self.covariances))

    @cached_property
    def log_peaks(self) -> Float[Array, " C"]:
        """Logarithm of each Gaussian's weight times its density at the mean, up to one constant."""
        return np.asarray(np.log(self.shares) - 0.5 * np.linalg.slogdet(self.covariances)[1])


@lru_cache(maxsize=1)
def load_pose_statistics() -> PoseStatistics:
    """The shipped statistics, checked against their sha256."""
    with np.load(io.BytesIO(read_weights("pose_prior.npz"))) as file:
        return PoseStatistics(**{name: file[name].astype(np.float64) for name in PoseStatistics.__dataclass_fields__})
