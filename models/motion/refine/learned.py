"""What the motion networks say of one person, as evidence for the fit over the whole clip, and as its correction."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from humanmm.models.body.body24 import ROTATED_JOINTS
from humanmm.models.body.kinematics import by_chunks, chunks
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.motion.fit.equations import Term
from humanmm.models.motion.fit.state import LongMotion
from humanmm.models.motion.networks.interfaces import AlignedMotion, Integrated, MotionNetworks
from humanmm.models.motion.refine.fit import RootVelocity

Array = np.ndarray

VELOCITY_WEIGHT = 3.0
LEAST_SIGMA_MS = 0.15
"""What the stated error of a velocity leaves out: somebody who stands is said to drift by a centimetre a second."""
MS_HMR_SHARE = 0.5
"""How much of ms-HMR's correction is made."""
_ROTATED = list(ROTATED_JOINTS)


@dataclass(frozen=True, eq=False)
class Learned:
    """The networks, and what they have to know of N frames besides the motion."""

    networks: MotionNetworks
    time_s: Float[Array, " N"]
    known: Bool[Array, " N"]
    confidence: Float[Array, " N"]
    shot: Int[Array, " N"]

    def read(self, motion: LongMotion) -> Integrated | None:
        """What the networks say of a motion; None: nothing."""
        return self.networks(self._aligned(motion))

    def terms(self, found: Integrated | None, frames: slice) -> Sequence[Term]:
        """The root's velocity as evidence for a run of frames."""
        if found is None:
            return ()
        velocity, sigma = found.velocity[frames], np.hypot(found.velocity_sigma[frames], LEAST_SIGMA_MS)
        return (RootVelocity(found.R_world_root[frames], velocity, sigma, self.time_s[frames], VELOCITY_WEIGHT),)

    def corrected(self, motion: LongMotion) -> LongMotion:
        """The motion with MS_HMR_SHARE of what the networks correct in its poses."""
        given = self._aligned(motion)
        found = self.networks(given)
        if found is None or found.rotations is None:
            return motion
        vectors = motion.vectors.copy()
        for frames in chunks(len(vectors)):
            R, R_found = (one[frames].astype(np.float64) for one in (given.rotations, found.rotations))
            residual = rotmat_to_rotvec(np.swapaxes(R, -1, -2) @ R_found)
            vectors[frames][:, _ROTATED] = rotmat_to_rotvec(R @ rotvec_to_rotmat(MS_HMR_SHARE * residual))
        return replace(motion, vectors=vectors)

    def _aligned(self, motion: LongMotion) -> AlignedMotion:
        rotations = by_chunks(_rotations, motion.vectors)
        return AlignedMotion(
            rotations, motion.pelvis_ref, motion.skeleton.rest_joints, self.time_s, self.known, self.confidence,
            self.shot,
        )  # fmt: skip


def _rotations(vectors: Float[Array, "n 24 3"]) -> Float[Array, "n 20 3 3"]:
    return rotvec_to_rotmat(vectors[:, _ROTATED].astype(np.float64)).astype(np.float32)
