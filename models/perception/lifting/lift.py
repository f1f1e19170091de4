"""The shipped lifter: landmarks in space and joint rotations of everybody, from what the pose networks saw.

A pose network looks at one picture: it misses half of a camera's pitch, leans bodies towards it and guesses limbs anew
in every frame. The lifter has seen what these networks say of rendered people whose pose is known (model card
weights/lifter.md), and looks at a second before and after each frame.
"""

from functools import lru_cache

import numpy as np
import torch
from jaxtyping import Float
from safetensors.torch import load

from humanmm.models.geometry.rotations import rotmat_to_rotvec
from humanmm.models.perception.interfaces import Lifted, PersonFrames
from humanmm.models.perception.lifting.features import lifter_input
from humanmm.models.perception.lifting.network import LifterNetwork
from humanmm.models.records.tracks import PoseEstimates
from humanmm.models.weights.shipped import read_weights

Array = np.ndarray

CORRECTION = 0.6
"""How much of the network's correction of landmarks is made. It has learnt from rendered people, whom the pose networks
see worse than real ones: with 1.0, 0.7 and 0.5 eleven rendered development clips have a PA-MPJPE of 56.7, 57.6 and
59.4 mm (65.6 without), the real clip A of 59.4, 56.2 and 54.4 (60.7)."""
CHUNK_S = 8.0
"""A long track is lifted in pieces; each sees as far beyond its ends as the network can."""


def lift(frames: PersonFrames, K: Float[Array, "3 3"]) -> Lifted:
    """Landmarks and joint rotations of one person, by the shipped network (a `Lifter`)."""
    network, time_s = load_lifter(), frames.time_s
    pieces = []
    for start_s in np.arange(time_s[0], time_s[-1] + 1e-6, CHUNK_S):
        own = slice(*np.searchsorted(time_s, (start_s - 1e-6, start_s + CHUNK_S - 1e-6)))
        if own.start == own.stop:
            continue
        reach = time_s[own][0] - network.reach_s, time_s[own][-1] + network.reach_s
        seen = slice(*np.searchsorted(time_s, (reach[0] - 1e-6, reach[1] + 1e-6)))
        with torch.inference_mode():
            found = network(lifter_input(frames.chosen(seen), K))
        inner = slice(own.start - seen.start, own.stop - seen.start)
        pieces.append([
            part[0, inner].numpy() for part in (found.landmarks, found.pose, found.pose_log_sigma, found.swapped)
        ])  # fmt: skip
    landmarks, pose, log_sigma, swap_odds = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
    vectors = rotmat_to_rotvec(pose.astype(np.float64)).astype(np.float32)
    landmarks = frames.landmarks3d + CORRECTION * (landmarks - frames.landmarks3d)
    return Lifted(landmarks.astype(np.float32), PoseEstimates(vectors, np.exp(log_sigma), swap_odds))


@lru_cache(maxsize=1)
def load_lifter() -> LifterNetwork:
    """The shipped network, checked against its sha256."""
    network = LifterNetwork()
    network.load_state_dict({name: value.float() for name, value in load(read_weights("lifter.safetensors")).items()})
    return network.eval()
