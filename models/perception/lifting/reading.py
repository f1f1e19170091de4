"""A lifter's network on a whole track.

A long track is read in pieces, each with what its frames depend on.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float

from humanmm.models.geometry.rotations import rotmat_to_rotvec
from humanmm.models.perception.lifting.network import LifterInput, LifterNetwork
from humanmm.models.records.landmarks import with_sides_swapped
from humanmm.models.records.tracks import PoseEstimates
from humanmm.models.weights.eight_bits import shipped_network

Array = np.ndarray

CHUNK_S, CHUNK_FRAMES = 8.0, 512
"""A long track is lifted in pieces no longer than this; each sees as far beyond its ends as the network can."""
MOST_BEYOND = 768
"""Frames beyond either end at most: rates up to 150 Hz see all."""


class Reading(NamedTuple):
    """What a network says of n frames; a `Lifted` of a network that knows rotations."""

    landmarks3d: Float[Array, "n 33 3"]
    pose: PoseEstimates


def read_in_pieces(
    network: LifterNetwork, time_s: Float[Array, " n"], given: Callable[[slice], LifterInput]
) -> Reading:
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
    return Reading(landmarks, PoseEstimates(vectors, np.exp(log_sigma), swap_odds))


def with_sides_put_right(read: Callable[[Bool[Array, " n"]], Reading], num_frames: int) -> Reading:
    """What a network says of a track when it looks again with left and right put right where it holds them for swapped:
    a body whose sides are swapped is one that turns its back, for a few frames.

    `read` says what it says of the track with the sides of some frames swapped. Landmarks are named as they are given,
    rotations are those of the body put right (`PoseEstimates`).
    """
    found = read(np.zeros(num_frames, dtype=bool))
    are_swapped = found.pose.swap_odds > 0
    if not are_swapped.any():
        return found
    again = read(are_swapped)
    pose = replace(again.pose, swap_odds=found.pose.swap_odds)
    return Reading(with_sides_swapped(again.landmarks3d, are_swapped), pose)


def pieces(time_s: Float[Array, " n"], reach_s: float) -> Iterator[tuple[slice, slice]]:
    """Frames to be lifted together, and the frames that these depend on."""
    start = 0
    while start < len(time_s):
        stop = int(np.searchsorted(time_s, time_s[start] + CHUNK_S))
        stop = min(max(stop, start + 1), start + CHUNK_FRAMES)
        first, last = np.searchsorted(time_s, [time_s[start] - reach_s, time_s[stop - 1] + reach_s]).tolist()
        yield slice(start, stop), slice(max(first, start - MOST_BEYOND), min(max(last, stop), stop + MOST_BEYOND))
        start = stop


@lru_cache(maxsize=3)
def load_lifter(file: str) -> LifterNetwork:
    """A shipped network of this form, checked against its sha256."""
    return shipped_network(file, LifterNetwork.shaped_as)
