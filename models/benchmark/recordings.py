"""Performances of data sets that users own, the truths of their videos, and how multi-shot videos are cut from them.

World z up, metres, pixel centres at .5; lens distortion is not modelled.
"""

from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int

from humanmm.errors import InputError
from humanmm.models.evaluation.truth import header_arrays
from humanmm.models.synthetic.multishot import SHORTEST_CLIP_S, another_camera, cut_times

Array = np.ndarray

RATE_HZ = 30.0
"""Performances at about a multiple of this are thinned out to it, as the paper's videos are."""
SHORTEST_TURN_S = 0.5
"""Of a shot of `cut_in_turns`."""


@dataclass(frozen=True)
class ImageRecording:
    """F pictures in order, one camera, its people."""

    name: str
    fps: float
    pictures: tuple[Path, ...]
    joint_names: tuple[str, ...]
    people: tuple[Float[Array, "F J 3"], ...]
    observed: tuple[Bool[Array, "F"], ...]
    K: Float[Array, "3 3"]
    R_world_cam: Float[Array, "F 3 3"]
    t_world_cam: Float[Array, "F 3"]

    def truth(self, size: tuple[int, int]) -> dict[str, Array]:
        """Arrays of the whole video with motion.zarr's names; `size`: width and height of its pictures."""
        count = len(self.pictures)
        arrays = {
            **header_arrays("humanmm.truth/1", self.joint_names, count, (), self.fps, size),
            "cameras/K": np.tile(self.K, (count, 1, 1)),
            "cameras/R_world_cam": self.R_world_cam,
            "cameras/t_world_cam": self.t_world_cam,
        }
        for number, (joints, observed) in enumerate(zip(self.people, self.observed, strict=True)):
            arrays |= _person(number, joints, observed)
        return arrays


@dataclass(frozen=True)
class MultiviewSequence:
    """One performance of F frames, recorded by C static cameras at the same time."""

    name: str
    fps: float
    joint_names: tuple[str, ...]
    people: tuple[Float[Array, "F J 3"], ...]
    """The joints of each; NaN where one is not known."""
    K: Float[Array, "C 3 3"]
    R_world_cam: Float[Array, "C 3 3"]
    t_world_cam: Float[Array, "C 3"]
    videos: tuple[Path, ...]
    """One a camera, in step with the joints."""

    @property
    def num_frames(self) -> int:
        return len(self.people[0])


@dataclass(frozen=True)
class MultishotCut:
    """A multi-shot video of a performance: every shot is one camera's (paper section 4)."""

    sequence: MultiviewSequence
    fps: float
    step: int
    """Every `step`-th frame of the performance is used."""
    shots: tuple[tuple[int, int, int], ...]
    """Camera, and first and last frame + 1 in the video."""

    @property
    def num_frames(self) -> int:
        return self.shots[-1][2]

    def truth(self, size: tuple[int, int]) -> dict[str, Array]:
        """Arrays of the video with motion.zarr's names; `size`: width and height of its pictures."""
        sequence, cuts = self.sequence, [start for _, start, _ in self.shots[1:]]
        camera: Int[Array, " F"] = np.repeat(*np.array([(camera, end - start) for camera, start, end in self.shots]).T)
        arrays = {
            **header_arrays("humanmm.truth/1", sequence.joint_names, self.num_frames, cuts, self.fps, size),
            "cameras/K": sequence.K[camera],
            "cameras/R_world_cam": sequence.R_world_cam[camera],
            "cameras/t_world_cam": sequence.t_world_cam[camera],
        }
        for number, person in enumerate(sequence.people):
            joints = person[: self.num_frames * self.step : self.step]
            arrays |= _person(number, joints, np.isfinite(joints).all(axis=(1, 2)))
        return arrays


def cut_performance(sequence: MultiviewSequence, num_frames: int, num_cuts: int, *, seed: int) -> MultishotCut:
    """Random cuts and cameras, no camera twice in a row; the same seed gives the same cuts.

    `num_frames`: how many frames joints and videos have. InputError if they are too few.
    """
    step, fps, count = _thinned(sequence, num_frames)
    if count < (num_cuts + 1) * SHORTEST_CLIP_S * fps:
        raise _too_short(sequence, f"{num_cuts} cuts", count, fps)
    rng = np.random.default_rng([seed, num_cuts, *sequence.name.encode()])
    cuts = cut_times(count, num_cuts, fps, rng)
    camera, shots = -1, []
    for start, end in zip([0, *cuts], [*cuts, count], strict=True):
        camera = another_camera(camera, len(sequence.videos), rng)
        shots.append((camera, start, end))
    return MultishotCut(sequence, fps, step, tuple(shots))


def cut_in_turns(sequence: MultiviewSequence, num_frames: int) -> list[MultishotCut]:
    """A video for every two cameras: a third of it each is the one's, the other's, and the one's again.

    InputError if a third is shorter than half a second.
    """
    step, fps, count = _thinned(sequence, num_frames)
    ends = [round(count * third / 3) for third in range(4)]
    if count < 3 * SHORTEST_TURN_S * fps:
        raise _too_short(sequence, "two cuts", count, fps)
    return [
        MultishotCut(sequence, fps, step, tuple(zip((one, other, one), ends[:-1], ends[1:], strict=True)))
        for one, other in combinations(range(len(sequence.videos)), 2)
    ]


def _thinned(sequence: MultiviewSequence, num_frames: int) -> tuple[int, float, int]:
    """Every which frame is used, and how many a second and in all these are."""
    step = max(1, round(sequence.fps / RATE_HZ))
    return step, sequence.fps / step, -(-num_frames // step)


def _too_short(sequence: MultiviewSequence, what: str, count: int, fps: float) -> InputError:
    return InputError(f"{sequence.name} is too short for {what}: {count} frames at {fps:g} a second")


def _person(number: int, joints: Float[Array, "F J 3"], observed: Bool[Array, "F"]) -> dict[str, Array]:
    prefix = f"people/{number:02d}"
    return {
        f"{prefix}/frame": np.arange(len(joints), dtype=np.int32),
        f"{prefix}/joints": joints,
        f"{prefix}/observed": observed,
        f"{prefix}/visibility": np.isfinite(joints).all(axis=2).mean(axis=1).astype(np.float32),
    }
