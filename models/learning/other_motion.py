"""More motion than was rendered: takes of motion capture before the cameras of rendered windows, with their errors.

A pose network's errors of one window are laid on another motion. That is not what it would have said, for errors depend
on the pose; but a take costs nothing this way, and how people move is learnt from all of them.
"""

import functools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float

from humanmm.models.body.kinematics import seen_rotations
from humanmm.models.body.landmarks import load_landmarks
from humanmm.models.geometry.projection import project, world_to_camera
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.learning.pairs import NEAREST_M, TEMPO
from humanmm.models.learning.windows import PairErrors, Windows, by_window
from humanmm.models.perception.lifting.features import points_in_view, view_axes
from humanmm.models.perception.regions import BODY_MARGIN
from humanmm.models.rendering.places.crouching import CROUCHED, crouched
from humanmm.models.rendering.places.recombination import loosened, with_arms_of
from humanmm.models.rendering.places.takes import random_body, shape
from humanmm.models.synthetic.choreography import KINDS, choreography
from humanmm.models.synthetic.mocap import MocapSequence, pose_actor

Array = np.ndarray

BODIES_A_TAKE, LOOSENED_A_TAKE = 2, 6
"""So often each take is shown as it is, so often with the arms of another, and so often loosened
(`recombination.loosened`), each time on another body."""
ROUTINES, ROUTINE_S = 120, 12.0
ERROR_SCALE = (0.3, 1.0, 1.6)
"""Errors of 3D landmarks are laid on with a factor: smallest, mean, largest."""
MOSTLY_SEEN = 0.5
SHORTEST = 8
"""Takes of no more frames are left out."""


@dataclass(frozen=True, eq=False)
class Take:
    """A take on one body, world axes."""

    fps: float
    landmarks: Float[Array, "N 33 3"]
    rotations: Float[Array, "N 20 3 3"]
    contacts: Float[Array, "N 4"]
    is_routine: bool = False
    """Of `models.synthetic.choreography`, nobody's."""


def takes_on_bodies(
    sequences: Iterable[MocapSequence], rng: np.random.Generator, *, are_routines: bool = False
) -> list[Take]:
    """Every sequence on a random body."""
    takes = []
    for sequence in sequences:
        actor = pose_actor(sequence, rng, betas=shape(random_body(rng), rng))
        if len(actor.joints) > SHORTEST:
            takes.append(
                Take(
                    float(sequence.fps),
                    load_landmarks().place(actor.betas, actor.joints, actor.R_world_joint).astype(np.float32),
                    seen_rotations(actor.R_world_joint[:, 0], actor.body_pose).astype(np.float32),
                    actor.contacts.astype(np.float32),
                    are_routines,
                )
            )
    return takes


def takes_to_learn_from(sequences: Sequence[MocapSequence], rng: np.random.Generator) -> list[Take]:
    """Every sequence on random bodies, as it is and with limbs of others; and routines."""
    again = [take for take in sequences for _ in range(BODIES_A_TAKE)]
    mixed = [with_arms_of(take, sequences[int(rng.integers(len(sequences)))], rng) for take in again]
    loose = [loosened(take, sequences, rng) for take in sequences for _ in range(LOOSENED_A_TAKE)]
    made = [take for take in (*again, *mixed, *loose) if take is not None]
    takes = takes_on_bodies([crouched(take, rng) if rng.random() < CROUCHED else take for take in made], rng)
    return takes + takes_on_bodies(choreographed(ROUTINES, rng), rng, are_routines=True)


def choreographed(count: int, rng: np.random.Generator) -> list[MocapSequence]:
    """Kicks, spins, floor work and acrobatics that nobody performed."""
    return [choreography(KINDS[k % len(KINDS)], "routine", ROUTINE_S, rng) for k in range(count)]


def with_routines(weight: Float[Array, " n"], is_routine: Bool[Array, " n"], fraction: float) -> Float[Array, " n"]:
    """Probabilities by weight, with a fraction of all for routines, if there are any beside other motion."""
    probability = weight / weight.sum()
    own = probability[is_routine].sum()
    if 0 < own < 1:
        probability = probability * np.where(is_routine, fraction / own, (1 - fraction) / (1 - own))
    return np.asarray(probability)


class OtherMotion:
    """Draws windows; `arrays` are those of the rendered ones, a fraction `routines` of them shows a routine."""

    def __init__(
        self, takes: Sequence[Take], arrays: Mapping[str, Array], windows: Windows, errors: PairErrors,
        *, routines: float,
    ) -> None:  # fmt: skip
        self._takes, self._arrays, self._windows, self._errors = takes, arrays, windows, errors
        seconds = np.array([len(take.landmarks) / take.fps for take in takes])
        self._probability = with_routines(seconds, np.array([take.is_routine for take in takes]), routines)
        self._usable = np.flatnonzero(windows.exists.float().mean(dim=1).numpy() > MOSTLY_SEEN)

    def draw(self, count: int, rng: np.random.Generator) -> Windows:
        """So many windows."""
        which = self._usable[rng.integers(len(self._usable), size=count)]
        chosen = rng.choice(len(self._takes), size=count, p=self._probability)
        parts = [self._placed(int(w), self._takes[int(k)], rng) for w, k in zip(which, chosen, strict=True)]
        in_camera, rotations, contacts = (np.stack(part) for part in zip(*parts, strict=True))
        B, n = in_camera.shape[:2]
        landmarks = in_camera.reshape(B * n, 33, 3)
        K = self._arrays["K"][which].reshape(-1, 3, 3).astype(np.float64)
        pixels = project(landmarks, K, near_m=NEAREST_M)
        hips = pixels[:, [23, 24]].mean(axis=1)
        reach = np.linalg.norm(pixels - hips[:, None], axis=-1).max(axis=1).reshape(B, n)
        side = (2 * BODY_MARGIN * reach * np.exp(rng.normal(0, 0.05, (B, 1)))).ravel()
        R_cam_view, size = view_axes(hips, K), side / K[:, 0, 0]
        points = points_in_view(pixels, R_cam_view, size, K)
        truth = (landmarks - landmarks[:, [23, 24]].mean(axis=1, keepdims=True)) @ R_cam_view
        rotations = rotations.reshape(B * n, -1, 3, 3)
        rotations[:, 0] = np.swapaxes(R_cam_view, -1, -2) @ rotations[:, 0]
        tensor = functools.partial(by_window, num_windows=B)
        smallest, mean, largest = ERROR_SCALE
        scale = np.clip(rng.normal(mean, 0.25, (B, 1, 1, 1)), smallest, largest).astype(np.float32)
        true = tensor(truth)
        systematic = (true.flatten(-2) @ self._errors.systematic).reshape(true.shape)
        index, nothing = torch.from_numpy(which), torch.zeros(B, n, dtype=torch.bool)
        return Windows(
            time_s=self._windows.time_s[index], exists=self._windows.exists[index],
            points=tensor(points) + self._errors.points[index], certainty=self._windows.certainty[index],
            landmarks=true + torch.from_numpy(scale) * (systematic + self._errors.landmarks[index]),
            size=tensor(size), truth=true, pose=tensor(rotations), swapped=nothing, clear=nothing,
            contacts=torch.from_numpy(contacts),
        )  # fmt: skip

    def _placed(self, window: int, take: Take, rng: np.random.Generator) -> tuple[Array, Array, Array]:
        """A part of a take where the window's person was, heading anywhere: landmarks in camera axes, rotations (the
        root's in camera axes), contacts."""
        arrays = self._arrays
        R_world_cam, t_world_cam = (arrays[name][window].astype(np.float64) for name in ("R_world_cam", "t_world_cam"))
        hips_cam = arrays["truth_cam"][window][:, [23, 24]].mean(axis=1)
        there = (np.einsum("nij,nj->ni", R_world_cam, hips_cam) + t_world_cam).mean(axis=0)
        at = arrays["time_s"][window] * rng.uniform(*TEMPO) * take.fps
        room = len(take.landmarks) - 1 - at[-1]
        at = np.clip(at + (rng.uniform(0, room) if room > 0 else 0.0), 0, len(take.landmarks) - 1.001)
        before, nearest = at.astype(int), np.rint(at).astype(int)
        fraction = (at - before)[:, None, None]
        landmarks = (1 - fraction) * take.landmarks[before] + fraction * take.landmarks[before + 1]
        R = rotvec_to_rotmat(np.array([0.0, 0.0, rng.uniform(0, 2 * np.pi)]))
        level = np.array([1.0, 1.0, 0.0])
        here = landmarks[:, [23, 24]].mean(axis=(0, 1))
        landmarks = (landmarks - here * level) @ R.T + there * level
        rotations = take.rotations[nearest].astype(np.float64)
        rotations[:, 0] = np.swapaxes(R_world_cam, -1, -2) @ (R @ rotations[:, 0])
        return world_to_camera(landmarks, R_world_cam, t_world_cam), rotations, take.contacts[nearest]
