"""How far a fitted pose is expected to be off: by how far it ends from what the lifter says.

Lifter and fit share the lifter's landmarks, but the fit sees 2D keypoints, joint ranges and how people move as well.
Where these and the landmarks agree both are mostly right.
"""

import numpy as np
from jaxtyping import Float

from humanmm.models.geometry.alignment import umeyama_alignment
from humanmm.models.records.landmarks import LIMBS

Array = np.ndarray

FACTOR, POWER = 0.48, 0.60
"""Expected error and distance in metres: a power law through the logarithms of both, made as large as errors are in the
mean, on 5,674 frames of 28 development clips: those of 40 to 50, 60 to 70 and 100 to 130 mm expected have errors of 45,
63 and 101 mm in the mean (docs/measurements/world.md)."""


def expected_error_m(fitted: Float[Array, "n 33 3"], lifted: Float[Array, "n 33 3"]) -> Float[Array, " n"]:
    """Mean distance of the joints from the true ones after a similarity (PA-MPJPE), metres, that each frame's body is
    expected to have.

    `fitted`, `lifted`: the landmarks of the fitted body and those that it was fitted to, metres, each in any axes.
    """
    theirs, ours = (points[:, list(LIMBS)].astype(np.float64) for points in (lifted, fitted))
    apart = np.linalg.norm(umeyama_alignment(theirs, ours, unique=False).apply(theirs) - ours, axis=-1).mean(axis=1)
    return np.asarray(FACTOR * apart**POWER)
