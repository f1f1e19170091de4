"""The shipped lifter: landmarks in space and joint rotations of everybody, from what the pose networks saw.

A pose network looks at one picture: it misses half of a camera's pitch, leans bodies towards it and guesses limbs anew
in every frame. The lifter has seen what these networks say of rendered people whose pose is known (model card
weights/lifter.md), and looks at a second before and after each frame.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache

import numpy as np
import torch
from jaxtyping import Float
from safetensors.torch import load

from humanmm.models.geometry.rotations import rotmat_to_rotvec
from humanmm.models.perception.interfaces import Lifted, PersonFrames
from humanmm.models.perception.lifting.features import lifter_input
from humanmm.models.perception.lifting.network import LifterInput, LifterNetwork
from humanmm.models.records.tracks import PoseEstimates
from humanmm.models.weights.shipped import read_weights

Array = np.ndarray

CORRECTION = 0.7
"""How much of the network's correction of landmarks is made. It has learnt from rendered people, whom the pose networks
see worse than real ones: with 0.6, 0.7, 0.8 and 1.0 the real clip A has a PA-MPJPE of 46.5, 45.1, 46.4 and 52.3 mm (a
W-MPJPE of 74, 76, 80 and 85 mm), four rendered development clips have 50.4, 49.3, 48.3 and 48.0 mm (125, 125, 124 and
114 mm)."""
CHUNK_S, CHUNK_FRAMES = 8.0, 512
"""A long track is lifted in pieces no longer than this; each sees as far beyond its ends as the network can."""
MOST_BEYOND = 768
"""Frames beyond either end at most: rates up to 150 Hz see all."""


def lift(frames: PersonFrames, K: Float[Array, "3 3"]) -> Lifted:
    """Landmarks and joint rotations of one person, by the shipped network (a `Lifter`)."""
    found = read_in_pieces(load_lifter(), frames.time_s, lambda seen: lifter_input(frames.chosen(seen), K))
    landmarks = frames.landmarks3d + CORRECTION * (found.landmarks3d - frames.landmarks3d)
    return replace(found, landmarks3d=landmarks.astype(np.float32))


def read_in_pieces(network: LifterNetwork, time_s: Float[Array, " n"], given: Callable[[slice], LifterInput]) -> Lifted:
    """What a network says of a whole track; `given` has its input of some of the frames."""
    read = []
    for own, seen in pieces(time_s, network.reach_s):
        with torch.inference_mode():
            found = network(given(seen))
        inner = slice(own.start - seen.start, own.stop - seen.start)
        read.append([
            part[0, inner].numpy() for part in (found.landmarks, found.pose, found.pose_log_sigma, found.swapped)
        ])  # fmt: skip
    landmarks, pose, log_sigma, swap_odds = (np.concatenate(parts) for parts in zip(*read, strict=True))
    vectors = rotmat_to_rotvec(pose.astype(np.float64)).astype(np.float32)
    return Lifted(landmarks, PoseEstimates(vectors, np.exp(log_sigma), swap_odds))


def pieces(time_s: Float[Array, " n"], reach_s: float) -> Iterator[tuple[slice, slice]]:
    """Frames to be lifted together, and the frames that these depend on."""
    start = 0
    while start < len(time_s):
        stop = int(np.searchsorted(time_s, time_s[start] + CHUNK_S))
        stop = min(max(stop, start + 1), start + CHUNK_FRAMES)
        first, last = np.searchsorted(time_s, [time_s[start] - reach_s, time_s[stop - 1] + reach_s]).tolist()
        yield slice(start, stop), slice(max(first, start - MOST_BEYOND), min(max(last, stop), stop + MOST_BEYOND))
        start = stop


@lru_cache(maxsize=2)
def load_lifter(file: str = "lifter.safetensors") -> LifterNetwork:
    """A shipped network of this form, checked against its sha256."""
    network = LifterNetwork()
    network.load_state_dict({name: value.float() for name, value in load(read_weights(file)).items()})
    return network.eval()
