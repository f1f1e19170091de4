"""Clips of several shots for ms-HMR, trajectory predictor and refiner: true motion, and what `hmr` would make of it.

Half of them are rendered windows with the fit of what the pose networks saw there. The others are takes of motion
capture: each shot of them has the errors of a rendered window in which somebody holds himself alike, so that a cut
changes the errors and not the motion, as in a video.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from humanmm.models.body.body24 import OTHER_SIDE, load_body
from humanmm.models.body.kinematics import seen_rotations
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.learning.other_motion import choreographed
from humanmm.models.learning.pairs import TEMPO
from humanmm.models.learning.windows import CONTACT_SWAP, JOINT_SWAP, MIRROR
from humanmm.models.motion.networks.sequence import RATE_HZ, MotionSequence
from humanmm.models.perception.lifting.network import Tensors
from humanmm.models.rendering.actors import with_contacts
from humanmm.models.rendering.places.takes import random_body, shape
from humanmm.models.synthetic.mocap import MocapSequence, pose_actor

Array = np.ndarray

FRAMES = 96
"""Of a clip: 3.2 s."""
MOST_SHOTS, SHORTEST = 4, 14
"""Shots of a clip, and frames of the shortest."""
CANDIDATES = 24
"""Of so many random windows the one whose pose is nearest gives its errors."""
STRENGTH = (0.4, 1.5)
"""Errors are laid on with a factor between these, another one for each clip: real people are fitted better."""
HABIT_RAD = 0.06
"""Standard deviation of a constant error of every joint: somebody else's proportions."""
SWAPPED_RAD = 1.5
"""A fit whose root is this far off (median) has front and back or left and right wrong: `shots` would put it right."""
TILT_RAD, YAW_RAD = 0.035, 0.15
"""Errors of a shot's vertical and of the cut before it: standard deviations."""


@dataclass(frozen=True, eq=False)
class Take:
    """A take on one body at its own rate, N frames."""

    fps: float
    rotations: Float[Array, "N 20 3 3"]
    pelvis: Float[Array, "N 3"]
    contacts: Float[Array, "N 4"]
    rest_joints: Float[Array, "24 3"]


def motion_takes(sequences: Sequence[MocapSequence], rng: np.random.Generator, *, routines: int) -> list[Take]:
    """Every sequence on a random body, and routines: kicks, spins, floor work."""
    takes = []
    for sequence in [*sequences, *choreographed(routines, rng)]:
        actor = with_contacts(pose_actor(sequence, rng, betas=shape(random_body(rng), rng)), sequence.fps)
        rotations = seen_rotations(actor.R_world_root, actor.body_pose).astype(np.float32)
        rest = load_body().rest_joints(actor.betas).astype(np.float32)
        takes.append(Take(sequence.fps, rotations, actor.joints[:, 0], actor.contacts, rest))
    return [take for take in takes if len(take.pelvis) > SHORTEST]


@dataclass(frozen=True, eq=False)
class ErrorWindow:
    """A rendered window at RATE_HZ, m frames: the true motion, and how the fit is off."""

    rotations: Float[Array, "m 20 3 3"]
    """True."""
    pelvis: Float[Array, "m 3"]
    contacts: Float[Array, "m 4"]
    rest_joints: Float[Array, "24 3"]
    turned: Float[Array, "m 20 3"]
    """Errors of rotations, in each joint's own axes, rotation vectors."""
    shifted: Float[Array, "m 3"]
    """Errors of the pelvis in the world, metres."""
    known: Float[Array, " m"]
    confidence: Float[Array, " m"]


def error_windows(arrays: Mapping[str, Array]) -> list[ErrorWindow]:
    """Of fitted windows (`learning.pairs.PairWindow` and `learning.body_fits.FittedWindow`, W windows each)."""
    found = []
    for w in range(len(arrays["time_s"])):
        rows = np.flatnonzero(arrays["fitted"][w])
        if len(rows) < 2:
            continue
        of_frame = (name for name, values in arrays.items() if values.shape[1:2] == arrays["time_s"].shape[1:])
        one = {name: arrays[name][w][rows] for name in of_frame}
        R_world_cam = one["R_world_cam"].astype(np.float64)
        true = seen_rotations(R_world_cam @ one["R_cam_root"], one["body_pose"])
        fit = seen_rotations(R_world_cam @ one["R_cam_root_fitted"], one["body_pose_fitted"])
        turned = rotmat_to_rotvec(np.swapaxes(true, -1, -2) @ fit)
        if np.median(np.linalg.norm(turned[:, 0], axis=-1)) > SWAPPED_RAD:
            continue
        pelvis = np.einsum("nij,nj->ni", R_world_cam, one["joints_cam"][:, 0]) + one["t_world_cam"]
        shifted = np.einsum("nij,nj->ni", R_world_cam, one["pelvis_cam_fitted"] - one["joints_cam"][:, 0])
        seconds = one["time_s"] - one["time_s"][0]
        at = np.arange(0, seconds[-1] + 1e-6, 1 / RATE_HZ)
        row = np.interp(at, seconds, np.arange(len(seconds)))
        rest = load_body().rest_joints(arrays["betas"][w].astype(np.float64))
        nearest = np.rint(row).astype(int)
        found.append(
            ErrorWindow(
                _between(true, row), _between(pelvis, row), one["contacts"][nearest], rest, _between(turned, row),
                _between(shifted, row), one["observed"][nearest], _between(one["confidence_fitted"], row),
            )
        )  # fmt: skip
    return found


def _between(values: Float[Array, "N *rest"], row: Float[Array, " m"]) -> Float[Array, "m *rest"]:
    """Values at fractional rows; of rotations they are not quite rotations."""
    low = np.minimum(row.astype(int), len(values) - 1)
    high = np.minimum(low + 1, len(values) - 1)
    fraction = (row - low).reshape(-1, *(1,) * (values.ndim - 1))
    return np.asarray((1 - fraction) * values[low] + fraction * values[high], np.float32)


@dataclass(frozen=True, eq=False)
class MotionClips(Tensors):
    """B clips."""

    given: MotionSequence
    true: MotionSequence
    """Seen by cameras whose errors are those of `given`: only the body's own errors are to be mended."""
    contacts: Tensor
    """(B,n,4), 0 or 1."""
    exists: Tensor
    """(B,n) bool: the clip is not over."""


class ClipSource:
    """Draws clips."""

    def __init__(
        self, takes: Sequence[Take], windows: Sequence[ErrorWindow], *, whole: float, varied: bool = True
    ) -> None:
        """`whole`: fraction of clips that are rendered windows; `varied`: errors larger and smaller than they are, and
        habits that no window has."""
        self._takes, self._windows, self._whole, self._varied = takes, windows, whole, varied
        seconds = np.array([len(take.pelvis) / take.fps for take in takes])
        self._probability = seconds / seconds.sum()
        middle = [(window.rotations[len(window.rotations) // 2]) for window in windows]
        self._poses = np.stack([_heading_free(pose) for pose in middle])

    @property
    def summary(self) -> str:
        """What clips are made of."""
        minutes = sum(len(take.pelvis) / take.fps for take in self._takes) / 60
        return f"{len(self._windows)} fitted windows and {minutes:.0f} minutes of motion capture"

    def draw(self, count: int, rng: np.random.Generator) -> MotionClips:
        """So many clips; each is mirrored or not by chance."""
        clips = [self._window_clip(rng) if rng.random() < self._whole else self._take_clip(rng) for _ in range(count)]
        columns = {name: np.stack([clip[name] for clip in clips]) for name in clips[0]}
        true, turned = _orthonormal(columns["rotations"]), columns["turned"].astype(np.float64)
        strength = np.ones((count, 1, 1, 1))
        if self._varied:
            strength = rng.uniform(*STRENGTH, strength.shape)
            turned = strength * turned + rng.normal(0, HABIT_RAD, (count, 1, *turned.shape[2:]))
        rotations = true @ rotvec_to_rotmat(turned)
        cameras = columns["camera"]
        pelvis = columns["pelvis"] + columns["shifted"] * strength[..., 0]
        given_pelvis, true_pelvis = (
            np.einsum("bnij,bnj->bni", cameras, values - columns["centre"]) + columns["centre"]
            for values in (pelvis, columns["pelvis"])
        )
        rotations[:, :, 0], true[:, :, 0] = cameras @ rotations[:, :, 0], cameras @ true[:, :, 0]

        def tensor(values: Array) -> Tensor:
            return torch.from_numpy(np.ascontiguousarray(values, dtype=np.float32))

        given = MotionSequence(
            tensor(rotations), tensor(given_pelvis), tensor(columns["rest_joints"]), tensor(columns["known"]) > 0.5,
            tensor(columns["confidence"]), torch.from_numpy(columns["shot"]),
        )  # fmt: skip
        clips_drawn = MotionClips(
            given, replace(given, rotations=tensor(true), pelvis=tensor(true_pelvis)), tensor(columns["contacts"]),
            tensor(columns["exists"]) > 0.5,
        )  # fmt: skip
        return mirrored(clips_drawn, torch.from_numpy(rng.random(count) < 0.5))

    def _window_clip(self, rng: np.random.Generator) -> dict[str, Array]:
        """One rendered window, from where it begins."""
        window = self._windows[int(rng.integers(len(self._windows)))]
        m = len(window.pelvis)
        rows = np.minimum(np.arange(FRAMES), m - 1)
        return {
            "rotations": window.rotations[rows], "pelvis": window.pelvis[rows], "contacts": window.contacts[rows],
            "rest_joints": window.rest_joints, "turned": window.turned[rows], "shifted": window.shifted[rows],
            "known": window.known[rows], "confidence": window.confidence[rows], "exists": np.arange(FRAMES) < m,
            **_cameras(np.zeros(FRAMES, np.int64), window.pelvis[rows], rng),
        }  # fmt: skip

    def _take_clip(self, rng: np.random.Generator) -> dict[str, Array]:
        """A part of a take with the errors of a window for each shot."""
        take = self._takes[int(rng.choice(len(self._takes), p=self._probability))]
        row = np.arange(FRAMES) * (take.fps / RATE_HZ * rng.uniform(*TEMPO))
        room = len(take.pelvis) - 1 - row[-1]
        row = row + (rng.uniform(0, room) if room > 0 else 0.0)
        exists = row <= len(take.pelvis) - 1
        row = np.minimum(row, len(take.pelvis) - 1)
        rotations, pelvis = _between(take.rotations, row), _between(take.pelvis, row)
        shot = _shots(rng)
        turned, shifted = np.empty((FRAMES, 20, 3), np.float32), np.empty((FRAMES, 3), np.float32)
        known, confidence = np.empty(FRAMES, np.float32), np.empty(FRAMES, np.float32)
        for one in range(int(shot[-1]) + 1):
            frames = np.flatnonzero(shot == one)
            window = self._alike(rotations[frames[len(frames) // 2]], rng)
            m = len(window.pelvis)
            rows = _there_and_back(m, len(frames), rng)
            turned[frames], known[frames] = window.turned[rows], window.known[rows]
            confidence[frames] = window.confidence[rows]
            R = _heading(rotations[frames[len(frames) // 2], 0]) @ _heading(window.rotations[m // 2, 0]).T
            shifted[frames] = window.shifted[rows] @ R.T
        return {
            "rotations": rotations, "pelvis": pelvis, "contacts": take.contacts[np.rint(row).astype(int)],
            "rest_joints": take.rest_joints, "turned": turned, "shifted": shifted, "known": known,
            "confidence": confidence, "exists": exists, **_cameras(shot, pelvis, rng),
        }  # fmt: skip

    def _alike(self, pose: Float[Array, "20 3 3"], rng: np.random.Generator) -> ErrorWindow:
        """One of a few random windows, with a pose as near as can be."""
        chosen = rng.integers(len(self._windows), size=CANDIDATES)
        distance = np.abs(self._poses[chosen] - _heading_free(pose)).sum(axis=-1)
        return self._windows[int(chosen[np.argmin(distance)])]


def _shots(rng: np.random.Generator) -> Array:
    """(FRAMES,) index of each frame's shot; the first shot's index is anything."""
    count = int(rng.integers(1, MOST_SHOTS + 1))
    free = FRAMES - count * SHORTEST
    cuts = np.sort(rng.integers(0, free + 1, size=count - 1)) + SHORTEST * np.arange(1, count)
    shot = np.zeros(FRAMES, np.int64)
    for cut in cuts:
        shot[cut:] += 1
    return shot


def _there_and_back(have: int, want: int, rng: np.random.Generator) -> Array:
    """So many rows of a window, forwards and backwards if it is short."""
    order = np.concatenate([np.arange(have), np.arange(have - 2, 0, -1)])
    start = int(rng.integers(0, have - want + 1)) if have >= want else int(rng.integers(len(order)))
    return np.asarray(order[(start + np.arange(want)) % len(order)])


def _cameras(shot: Array, pelvis: Float[Array, "n 3"], rng: np.random.Generator) -> dict[str, Array]:
    """How the world of each shot is tilted and turned about where the person is, and the shots' indices."""
    camera, centre = np.empty((len(shot), 3, 3)), np.empty((len(shot), 3))
    for one in np.unique(shot):
        frames = shot == one
        lean, yaw = rng.normal(0, TILT_RAD, 2), rng.normal(0, YAW_RAD)
        camera[frames] = rotvec_to_rotmat(np.array([*lean, 0.0])) @ rotvec_to_rotmat(np.array([0.0, 0.0, yaw]))
        centre[frames] = pelvis[frames].mean(axis=0)
    return {"camera": camera, "centre": centre, "shot": shot + int(rng.integers(0, 32))}


def _heading(R_world_root: Float[Array, "3 3"]) -> Float[Array, "3 3"]:
    """The rotation about the vertical that faces as the root does."""
    x, y = R_world_root[:2, 2] if abs(R_world_root[2, 2]) < 0.9 else R_world_root[:2, 1]
    return np.asarray(rotvec_to_rotmat(np.array([0.0, 0.0, np.arctan2(y, x)])))


def _heading_free(rotations: Float[Array, "20 3 3"]) -> Float[Array, " k"]:
    """A pose as numbers that can be compared, wherever it faces."""
    return np.concatenate([rotations[0, 2] * 3, rotations[1:, :, :2].ravel()])


def _orthonormal(R: Float[Array, "*batch 3 3"]) -> Float[Array, "*batch 3 3"]:
    """The rotations nearest to means of rotations that are near each other (Gram-Schmidt)."""
    x = R[..., 0] / np.linalg.norm(R[..., 0], axis=-1, keepdims=True)
    y = R[..., 1] - (x * R[..., 1]).sum(axis=-1, keepdims=True) * x
    y = y / np.linalg.norm(y, axis=-1, keepdims=True)
    return np.stack([x, y, np.cross(x, y)], axis=-1).astype(np.float64)


def mirrored(clips: MotionClips, which: Tensor) -> MotionClips:
    """Clips `which` (B,) bool as a mirror shows them."""
    contacts = torch.where(which[:, None, None], clips.contacts[..., CONTACT_SWAP], clips.contacts)
    return replace(clips, given=_mirrored(clips.given, which), true=_mirrored(clips.true, which), contacts=contacts)


def _mirrored(motion: MotionSequence, which: Tensor) -> MotionSequence:
    rotations = motion.rotations[:, :, JOINT_SWAP] * MIRROR[:, None] * MIRROR
    return replace(
        motion,
        rotations=torch.where(which[:, None, None, None, None], rotations, motion.rotations),
        pelvis=torch.where(which[:, None, None], motion.pelvis * MIRROR, motion.pelvis),
        rest_joints=torch.where(
            which[:, None, None], motion.rest_joints[:, list(OTHER_SIDE)] * MIRROR, motion.rest_joints
        ),
    )
