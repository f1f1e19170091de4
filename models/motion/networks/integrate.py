"""The shipped motion networks on one person's aligned motion: corrected poses, velocity of the root."""

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
import torch
from jaxtyping import Float, Int

from humanmm.models.geometry.rotations import interpolate_rotations
from humanmm.models.motion.networks.interfaces import AlignedMotion, Integrated
from humanmm.models.motion.networks.ms_hmr import MsHmr
from humanmm.models.motion.networks.sequence import RATE_HZ, MotionSequence, product
from humanmm.models.motion.networks.trajectory import TrajectoryPredictor, TrajectoryRefiner
from humanmm.models.perception.lifting.features import batch_of_one
from humanmm.models.weights.eight_bits import shipped_network

Array = np.ndarray

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
    parts = []
    for own, seen in _chunks(count):
        even = _at(grid[seen], motion)
        with torch.inference_mode():
            corrected = even if ms_hmr is None else even.rotated_to(ms_hmr(even).rotations)
            found = refiner(corrected, predictor(corrected))
            change = product(even.rotations.transpose(-1, -2), corrected.rotations)
        inner = slice(own.start - seen.start, own.stop - seen.start)
        columns = found.velocity, torch.exp(found.log_sigma), change if ms_hmr else change[:, :, :1]
        parts.append([column[0, inner].numpy() for column in columns])
    velocity, sigma, changes = (np.concatenate(column) for column in zip(*parts, strict=True))
    velocity, sigma = (np.stack([np.interp(time_s, grid, one) for one in values.T], 1) for values in (velocity, sigma))
    R_root = motion.rotations[:, 0].astype(np.float64) @ interpolate_rotations(time_s, grid, changes[:, 0])
    if ms_hmr is None:
        return Integrated(R_root, velocity, sigma)
    rotations = np.empty_like(motion.rotations)
    for joint in range(rotations.shape[1]):
        rotations[:, joint] = motion.rotations[:, joint] @ interpolate_rotations(time_s, grid, changes[:, joint])
    return Integrated(R_root, velocity, sigma, rotations)


def _at(moments: Float[Array, " n"], motion: AlignedMotion) -> MotionSequence:
    """The motion at some moments, from the frames around them alone."""
    first = max(int(np.searchsorted(motion.time_s, moments[0], side="right")) - 1, 0)
    frames = slice(first, int(np.searchsorted(motion.time_s, moments[-1])) + 1)
    time_s, R = motion.time_s[frames], motion.rotations[frames].astype(np.float64)
    rotations = np.stack([interpolate_rotations(moments, time_s, R[:, k]) for k in range(R.shape[1])], axis=1)
    pelvis = np.stack([np.interp(moments, time_s, column) for column in motion.pelvis[frames].T], axis=1)
    rows = nearest_rows(moments, time_s)
    return MotionSequence(
        batch_of_one(rotations), batch_of_one(pelvis), batch_of_one(motion.rest_joints),
        torch.from_numpy(motion.known[frames][rows])[None], batch_of_one(motion.confidence[frames][rows]),
        torch.from_numpy(motion.shot[frames][rows].astype(np.int64))[None],
    )  # fmt: skip


def nearest_rows(at: Float[Array, " n"], time_s: Float[Array, " N"]) -> Int[Array, " n"]:
    """The frame nearest to each moment."""
    after = np.clip(np.searchsorted(time_s, at), 1, max(len(time_s) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(time_s) - 1)
    return np.asarray(np.where(at - time_s[before] <= time_s[after] - at, before, after))


def _chunks(count: int) -> Iterator[tuple[slice, slice]]:
    """Frames that are settled together, and the frames that are looked at for them."""
    for start in range(0, count, CHUNK):
        stop = min(start + CHUNK, count)
        yield slice(start, stop), slice(max(0, start - BEYOND), min(count, stop + BEYOND))


@lru_cache(maxsize=1)
def load_predictor() -> TrajectoryPredictor:
    """The shipped network, checked against its sha256."""
    return shipped_network("trajectory_predictor.safetensors", lambda _: TrajectoryPredictor())


@lru_cache(maxsize=1)
def load_refiner() -> TrajectoryRefiner:
    """The shipped network, checked against its sha256."""
    return shipped_network("trajectory_refiner.safetensors", lambda _: TrajectoryRefiner())


@lru_cache(maxsize=1)
def load_ms_hmr() -> MsHmr:
    """The shipped network, checked against its sha256."""
    return shipped_network("ms_hmr.safetensors", lambda _: MsHmr())
