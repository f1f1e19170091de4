"""What the motion networks say of one person, as evidence for the fit over the whole clip, and as its correction."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from humanmm.models.body.body24 import ROTATED_JOINTS
from humanmm.models.body.kinematics import by_chunks
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.motion.fit.equations import Term
from humanmm.models.motion.fit.state import LongMotion
from humanmm.models.motion.networks.interfaces import AlignedMotion, MotionNetworks
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

    def terms(self, motion: LongMotion) -> Callable[[slice], Sequence[Term]] | None:
        """The root's velocity as the networks read it from a motion, for the fit that starts there; None: unknown."""
        given = self._aligned(motion)
        found = self.networks(given)
        if found is None:
            return None
        R_root = (given.rotations if found.rotations is None else found.rotations)[:, 0]

        def of_frames(frames: slice) -> Sequence[Term]:
            velocity, sigma = found.velocity[frames], np.hypot(found.velocity_sigma[frames], LEAST_SIGMA_MS)
            return [RootVelocity(R_root[frames], velocity, sigma, self.time_s[frames], VELOCITY_WEIGHT)]

        return of_frames

    def corrected(self, motion: LongMotion) -> LongMotion:
        """The motion with MS_HMR_SHARE of what ms-HMR corrects; as it is, if the networks correct no poses."""
        given = self._aligned(motion)
        found = self.networks(given)
        if found is None or found.rotations is None:
            return motion
        residual = by_chunks(rotmat_to_rotvec, np.swapaxes(given.rotations, -1, -2) @ found.rotations)
        vectors = motion.vectors.copy()
        vectors[:, _ROTATED] = rotmat_to_rotvec(given.rotations @ rotvec_to_rotmat(MS_HMR_SHARE * residual))
        return replace(motion, vectors=vectors)

    def _aligned(self, motion: LongMotion) -> AlignedMotion:
        rotations = by_chunks(rotvec_to_rotmat, motion.vectors[:, _ROTATED].astype(np.float64))
        return AlignedMotion(
            rotations, motion.pelvis_ref, motion.skeleton.rest_joints, self.time_s, self.known, self.confidence,
            self.shot,
        )  # fmt: skip
