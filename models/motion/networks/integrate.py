"""The shipped motion networks on one person's aligned motion: corrected poses, contacts, velocity of the root."""

from collections.abc import Iterator
from functools import lru_cache
from typing import TypeVar

import numpy as np
import torch
from jaxtyping import Float, Int
from safetensors.torch import load
from torch import Tensor, nn

from humanmm.models.geometry.rotations import interpolate_rotations
from humanmm.models.motion.networks.interfaces import AlignedMotion, Integrated
from humanmm.models.motion.networks.ms_hmr import MsHmr
from humanmm.models.motion.networks.sequence import RATE_HZ, MotionSequence
from humanmm.models.motion.networks.trajectory import TrajectoryPredictor, TrajectoryRefiner
from humanmm.models.weights.shipped import read_weights

Array = np.ndarray
Net = TypeVar("Net", bound=nn.Module)

CHUNK, BEYOND = 600, 150
"""Frames read together, and frames that are read beyond either end: five seconds, past which nothing counts."""


def trajectory(motion: AlignedMotion) -> Integrated:
    """The shipped trajectory predictor and refiner, on poses as they are (a `MotionNetworks`)."""
    return integrate(motion, load_predictor(), load_refiner())


def all_networks(motion: AlignedMotion) -> Integrated:
    """The same on poses that the shipped ms-HMR has corrected (a `MotionNetworks`)."""
    return integrate(motion, load_predictor(), load_refiner(), load_ms_hmr())


def integrate(
    motion: AlignedMotion, predictor: TrajectoryPredictor, refiner: TrajectoryRefiner, ms_hmr: MsHmr | None = None
) -> Integrated:
    """What these networks say of one person's motion at RATE_HZ, brought back to its own frames."""
    time_s = motion.time_s
    count = max(2, int(np.ceil((time_s[-1] - time_s[0]) * RATE_HZ - 1e-6)) + 1)
    grid = time_s[0] + np.arange(count) / RATE_HZ
    nearest = nearest_rows(grid, time_s)
    joints = range(motion.rotations.shape[1])
    even = np.stack([interpolate_rotations(grid, time_s, motion.rotations[:, k]) for k in joints], axis=1)
    path = np.stack([np.interp(grid, time_s, column) for column in motion.pelvis.T], axis=1)
    parts = []
    for own, seen in _chunks(count):
        rows = nearest[seen]
        sequence = MotionSequence(
            _tensor(even[seen]), _tensor(path[seen]), _tensor(motion.rest_joints),
            torch.from_numpy(motion.known[rows])[None], _tensor(motion.confidence[rows]),
            torch.from_numpy(motion.shot[rows].astype(np.int64))[None],
        )  # fmt: skip
        with torch.inference_mode():
            corrected = sequence if ms_hmr is None else sequence.rotated_to(ms_hmr(sequence).rotations)
            found = refiner(corrected, predictor(corrected))
        inner = slice(own.start - seen.start, own.stop - seen.start)
        columns = corrected.rotations, found.velocity, torch.exp(found.log_sigma), torch.sigmoid(found.contacts)
        parts.append([column[0, inner].double().numpy() for column in columns])
    rotations, *columns_even = (np.concatenate(column) for column in zip(*parts, strict=True))
    velocity, sigma, contacts = (
        np.stack([np.interp(time_s, grid, column) for column in values.T], axis=1) for values in columns_even
    )
    if ms_hmr is None:
        return Integrated(velocity, sigma, contacts)
    residual = np.swapaxes(even, -1, -2) @ rotations
    at_frames = np.stack([interpolate_rotations(time_s, grid, residual[:, k]) for k in joints], axis=1)
    return Integrated(velocity, sigma, contacts, motion.rotations @ at_frames)


def nearest_rows(at: Float[Array, " n"], time_s: Float[Array, " N"]) -> Int[Array, " n"]:
    """The frame nearest to each moment."""
    after = np.clip(np.searchsorted(time_s, at), 1, max(len(time_s) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(time_s) - 1)
    return np.asarray(np.where(at - time_s[before] <= time_s[after] - at, before, after))


def _tensor(values: Array) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(values, dtype=np.float32))[None]


def _chunks(count: int) -> Iterator[tuple[slice, slice]]:
    """Frames that are settled together, and the frames that are looked at for them."""
    for start in range(0, count, CHUNK):
        stop = min(start + CHUNK, count)
        yield slice(start, stop), slice(max(0, start - BEYOND), min(count, stop + BEYOND))


@lru_cache(maxsize=1)
def load_predictor() -> TrajectoryPredictor:
    """The shipped network, checked against its sha256."""
    return _filled(TrajectoryPredictor(), read_weights("trajectory_predictor.safetensors"))


@lru_cache(maxsize=1)
def load_refiner() -> TrajectoryRefiner:
    """The shipped network, checked against its sha256."""
    return _filled(TrajectoryRefiner(), read_weights("trajectory_refiner.safetensors"))


@lru_cache(maxsize=1)
def load_ms_hmr() -> MsHmr:
    """The shipped network, checked against its sha256."""
    return _filled(MsHmr(), read_weights("ms_hmr.safetensors"))


def _filled(network: Net, file: bytes) -> Net:
    network.load_state_dict({name: value.float() for name, value in load(file).items()})
    return network.eval()
