"""The shipped lifter: landmarks in space and joint rotations of everybody, from what the pose networks saw.

A pose network looks at one picture: it misses half of a camera's pitch, leans bodies towards it and guesses limbs anew
in every frame. The lifter has seen what these networks say of rendered people whose pose is known (model card
weights/lifter.md), and looks at a second before and after each frame.
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import torch
from jaxtyping import Float
from safetensors.torch import load

from humanmm.models.geometry.intrinsics import K_from_focal, default_focal_px
from humanmm.models.geometry.rotations import rotmat_to_rotvec
from humanmm.models.perception.interfaces import Lifted, Lifter, PersonFrames
from humanmm.models.perception.lifting.features import lifter_input
from humanmm.models.perception.lifting.network import LifterNetwork
from humanmm.models.records.tracks import MASK_SIDE, PersonTrack, PoseEstimates, ScenePeople
from humanmm.models.weights.shipped import read_weights

Array = np.ndarray

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
    return Lifted(landmarks, PoseEstimates(vectors, np.exp(log_sigma), swap_odds))


def keep(frames: PersonFrames, K: Float[Array, "3 3"]) -> Lifted:
    """The pose network's own landmarks, as they are (a `Lifter`)."""
    return Lifted(frames.landmarks3d)


def lifted_people(
    people: ScenePeople, lifter: Lifter, time_s: Float[Array, " F"], size: tuple[int, int]
) -> ScenePeople:
    """Everybody's tracks with the lifter's landmarks and poses; `size` is the picture's width and height."""
    K = K_from_focal(default_focal_px(*size), *size)
    return replace(people, tracks=tuple(_lifted(track, lifter, time_s, K) for track in people.tracks))


def _lifted(track: PersonTrack, lifter: Lifter, time_s: Float[Array, " F"], K: Float[Array, "3 3"]) -> PersonTrack:
    affine = track.mask_affine.astype(np.float64)
    frames = PersonFrames(
        time_s=time_s[track.frame],
        keypoints=track.keypoints2d.astype(np.float64),
        landmarks3d=track.landmarks3d.astype(np.float64),
        centre=affine @ np.array([MASK_SIDE / 2, MASK_SIDE / 2, 1.0]),
        side=np.linalg.norm(affine[:, :, 0], axis=1) * MASK_SIDE,
    )
    found = lifter(frames, K)
    return replace(track, landmarks3d=found.landmarks3d, pose=found.pose)


@lru_cache(maxsize=1)
def load_lifter() -> LifterNetwork:
    """The shipped network, checked against its sha256."""
    network = LifterNetwork()
    network.load_state_dict({name: value.float() for name, value in load(read_weights("lifter.safetensors")).items()})
    return network.eval()
