"""Windows of pairs as the lifter's training takes them: inputs, truth, and how both are varied."""

import functools
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from humanmm.models.body.body24 import OTHER_SIDE, ROTATED_JOINTS
from humanmm.models.body.kinematics import seen_rotations
from humanmm.models.geometry.projection import project
from humanmm.models.learning.pairs import NEAREST_M
from humanmm.models.perception.lifting.features import certainty_of, points_in_view, view_axes
from humanmm.models.perception.lifting.network import JOINTS, LifterInput, Tensors
from humanmm.models.perception.observation import MIN_CONFIDENCE
from humanmm.models.records.landmarks import COCO_LANDMARKS, LIMBS, NUM_LANDMARKS, SWAP

Array = np.ndarray

SWAPPED, CLEAR = 0.004, 0.01
"""Sides of the crop by which the keypoints fit the truth better with left and right swapped: to count as swapped, and
to be sure of it."""
RIDGE_M2 = 0.02**2
"""What is added to the variance of every true coordinate before errors are regressed on them."""
MIRROR = torch.tensor([-1.0, 1.0, 1.0])


JOINT_SWAP = [ROTATED_JOINTS.index(OTHER_SIDE[joint]) for joint in ROTATED_JOINTS]
CONTACT_SWAP = [2, 3, 0, 1]


@dataclass(frozen=True, eq=False)
class Windows(Tensors):
    """W windows of n frames. Truth has left and right named as the input has them."""

    time_s: Tensor
    exists: Tensor
    points: Tensor
    certainty: Tensor
    landmarks: Tensor
    size: Tensor
    truth: Tensor
    """(W,n,33,3): true landmarks about the mid-hip, view axes, metres."""
    pose: Tensor
    """(W,n,20,3,3): true rotations of the root (view axes) and the free joints."""
    swapped: Tensor
    """(W,n) bool: the input has left and right swapped."""
    clear: Tensor
    """(W,n) bool: and there is no doubt of it."""
    contacts: Tensor

    def __len__(self) -> int:
        return len(self.time_s)

    def chosen(self, index: Tensor) -> "Windows":
        """Some windows, copied."""
        return Windows(*(getattr(self, field.name)[index].clone() for field in fields(self)))

    def part(self, length: int, rng: np.random.Generator) -> "Windows":
        """So many frames of every window (all, where it has no more), beside each other or with others left out."""
        n = self.time_s.shape[1]
        length = min(length, n)
        stride = int(rng.integers(1, (n - 1) // (length - 1) + 1))
        span = (length - 1) * stride + 1
        first = int(rng.integers(0, n - span + 1))
        return Windows(*(getattr(self, field.name)[:, first : first + span : stride] for field in fields(self)))

    def given(self, has_landmarks: Tensor | None = None) -> LifterInput:
        """What the network is given; `has_landmarks` (W,) bool, all by default."""
        exists = self.exists
        has = exists if has_landmarks is None else exists & has_landmarks[:, None]
        seen = exists[..., None].float()
        return LifterInput(
            self.time_s, exists, self.points * seen[..., None], self.certainty * seen,
            self.landmarks * seen[..., None], has, self.size,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class PairErrors:
    """What the pose networks did wrong in W windows, left and right as they named them."""

    points: Tensor
    """(W,n,33,2): keypoints less true ones, sides of the crop."""
    landmarks: Tensor
    """(W,n,33,3): 3D landmarks less true ones and less `systematic` of these, metres."""
    systematic: Tensor
    """(99,99): true landmarks (flattened) times this are the part of their errors that the pose decides: legs are seen
    0.6 times as deep as they reach, trunks lean. It is of any motion; the rest is of these windows."""


def windows_of(arrays: Mapping[str, Array]) -> tuple[Windows, PairErrors]:
    """Windows and errors of the arrays of a set of pairs (`learning.pairs.PairWindow`, W windows each)."""
    W, n = arrays["time_s"].shape
    of_frame = {name: array for name, array in arrays.items() if array.shape[:2] == (W, n)}
    flat = {name: array.reshape(W * n, *array.shape[2:]) for name, array in of_frame.items()}
    K, region = flat["K"].astype(np.float64), flat["region"].astype(np.float64)
    R_cam_view, size = view_axes(region[:, :2], K), region[:, 2] / K[:, 0, 0]
    keypoints, truth_cam = flat["keypoints"].astype(np.float64), flat["truth_cam"].astype(np.float64)
    pixels = project(truth_cam, K, near_m=NEAREST_M)
    swapped, clear = _sides(pixels, keypoints, region[:, 2])
    truth = (truth_cam - truth_cam[:, [23, 24]].mean(axis=1, keepdims=True)) @ R_cam_view
    truth = np.where(swapped[:, None, None], truth[:, SWAP], truth)
    pixels = np.where(swapped[:, None, None], pixels[:, SWAP], pixels)
    points, true_points = (points_in_view(one, R_cam_view, size, K) for one in (keypoints[..., :2], pixels))
    root = np.swapaxes(R_cam_view, -1, -2) @ flat["R_cam_root"]
    pose = seen_rotations(root, flat["body_pose"])
    landmarks = flat["landmarks3d"].astype(np.float64)
    seen = flat["confidence"] >= MIN_CONFIDENCE
    tensor = functools.partial(by_window, num_windows=W)
    windows = Windows(
        time_s=torch.from_numpy(arrays["time_s"].astype(np.float32)),
        exists=tensor(seen) > 0,
        points=tensor(points),
        certainty=tensor(certainty_of(flat["keypoint_sigma"] / region[:, 2:3])),
        landmarks=tensor(landmarks),
        size=tensor(size),
        truth=tensor(truth),
        pose=tensor(pose),
        swapped=tensor(swapped) > 0,
        clear=tensor(clear) > 0,
        contacts=tensor(flat["contacts"]),
    )
    off = landmarks - truth
    systematic = systematic_errors(truth[seen], off[seen])
    residual = off - (truth.reshape(len(truth), -1) @ systematic).reshape(off.shape)
    errors = PairErrors(
        tensor(np.clip(points - true_points, -0.3, 0.3)), tensor(residual),
        torch.from_numpy(systematic.astype(np.float32)),
    )  # fmt: skip
    return windows, errors


def systematic_errors(truth: Float[Array, "N 33 3"], off: Float[Array, "N 33 3"]) -> Float[Array, "99 99"]:
    """The matrix S for which the errors of landmarks are best foretold as `truth @ S` (ridge regression), the same for
    people and their mirror images."""
    mirror = MIRROR.numpy()
    x, y = (np.concatenate([v, (v * mirror)[:, SWAP]]).reshape(-1, 3 * NUM_LANDMARKS) for v in (truth, off))
    return np.asarray(np.linalg.solve(x.T @ x + RIDGE_M2 * max(len(x), 1) * np.eye(x.shape[1]), x.T @ y))


def by_window(rows: Float[Array, "N *shape"], num_windows: int) -> Float[Tensor, "W n *shape"]:
    """Numbers of all frames of W windows, one window after the other, as a float32 tensor of windows."""
    shaped = np.ascontiguousarray(rows, dtype=np.float32).reshape(num_windows, -1, *rows.shape[1:])
    return torch.from_numpy(shaped)


def _sides(
    pixels: Float[Array, "N 33 2"], keypoints: Float[Array, "N 33 3"], side: Float[Array, " N"]
) -> tuple[Array, Array]:
    """In which frames the keypoints have left and right swapped, and in which that is beyond doubt."""
    limbs = list(LIMBS)

    def off(found: Array) -> Array:
        distance = np.linalg.norm(pixels[:, limbs] - found[:, limbs, :2], axis=-1) / side[:, None]
        return np.asarray(np.minimum(distance, 0.15).mean(axis=1))

    gain = off(keypoints) - off(keypoints[:, SWAP])
    return gain > SWAPPED, np.abs(gain) > CLEAR


@dataclass(frozen=True)
class Variation:
    """How a batch is varied: standard deviations and probabilities."""

    roll_rad: float = 0.15
    points: tuple[float, float] = (0.002, 0.006)
    """Noise of keypoints, each frame's and the window's, sides of the crop: real people's joints are not quite where a
    rendered body has them."""
    landmarks_m: tuple[float, float] = (0.01, 0.02)
    """The same of 3D landmarks."""
    size: float = 0.2
    """Of the logarithm: the focal length is hardly known when people are lifted."""
    tempo: float = 0.1
    swapped: float = 0.15
    """Windows in which a run of frames has left and right swapped."""
    hidden: float = 0.03
    coco: float = 0.15
    """Windows that have COCO's keypoints alone."""


def varied(windows: Windows, variation: Variation, generator: torch.Generator) -> tuple[Windows, LifterInput]:
    """The windows mirrored, rolled about the view, with noise, swaps and holes; and what the network is given."""

    def normal(*shape: int) -> Tensor:
        return torch.randn(*shape, generator=generator)

    def chance(*shape: int) -> Tensor:
        return torch.rand(*shape, generator=generator)

    B, n = windows.time_s.shape
    windows = _mirrored(windows, chance(B) < 0.5)
    windows = _rolled(windows, variation.roll_rad * normal(B))
    (own_px, window_px), (own_m, window_m) = variation.points, variation.landmarks_m
    k = NUM_LANDMARKS
    windows = replace(
        windows,
        points=windows.points + own_px * normal(B, n, k, 2) + window_px * normal(B, 1, k, 2),
        landmarks=windows.landmarks + own_m * normal(B, n, k, 3) + window_m * normal(B, 1, k, 3),
        size=windows.size * torch.exp(variation.size * normal(B, 1)),
        time_s=windows.time_s * torch.exp(variation.tempo * normal(B, 1)),
    )
    runs = torch.zeros(B, n, dtype=torch.bool)
    for window in torch.nonzero(chance(B) < variation.swapped)[:, 0].tolist():
        start, length = (int(v) for v in (chance(2) * torch.tensor([n, n - 1])).tolist())
        runs[window, start : start + length + 1] = True
    windows = _renamed(windows, runs)
    has_landmarks = chance(B) >= variation.coco
    certainty = torch.where(has_landmarks[:, None, None], windows.certainty, certainty_of_coco(windows.certainty))
    certainty = certainty * (chance(B, 1, k) >= variation.hidden)
    holes = chance(B, n) < 0.2 * chance(B, 1)
    windows = replace(windows, certainty=certainty, exists=windows.exists & ~holes)
    return windows, windows.given(has_landmarks)


def certainty_of_coco(certainty: Tensor) -> Tensor:
    """How sure keypoints (…,33) are where COCO's are given alone."""
    named = torch.zeros(NUM_LANDMARKS)
    named[list(COCO_LANDMARKS)] = 1.0
    return certainty * named


def _mirrored(windows: Windows, which: Tensor) -> Windows:
    """Some windows (B,) seen in a mirror."""

    def pick(mirror: Tensor, own: Tensor) -> Tensor:
        return torch.where(which.reshape(-1, *[1] * (own.ndim - 1)), mirror, own)

    pose = (MIRROR[:, None] * windows.pose * MIRROR)[:, :, JOINT_SWAP]
    return replace(
        windows,
        points=pick((windows.points * MIRROR[:2])[:, :, SWAP], windows.points),
        certainty=pick(windows.certainty[:, :, SWAP], windows.certainty),
        landmarks=pick((windows.landmarks * MIRROR)[:, :, SWAP], windows.landmarks),
        truth=pick((windows.truth * MIRROR)[:, :, SWAP], windows.truth),
        pose=pick(pose, windows.pose),
        contacts=pick(windows.contacts[..., CONTACT_SWAP], windows.contacts),
    )


def _rolled(windows: Windows, angle: Tensor) -> Windows:
    """Every window rotated about the viewing ray."""
    R = torch.zeros(len(angle), 1, 3, 3)
    R[:, 0, 0, 0], R[:, 0, 1, 1], R[:, 0, 2, 2] = torch.cos(angle), torch.cos(angle), 1.0
    R[:, 0, 0, 1], R[:, 0, 1, 0] = -torch.sin(angle), torch.sin(angle)
    back = R.transpose(-1, -2)
    root = R @ windows.pose[:, :, 0]
    return replace(
        windows,
        points=windows.points @ back[..., :2, :2],
        landmarks=windows.landmarks @ back,
        truth=windows.truth @ back,
        pose=torch.cat([root[:, :, None], windows.pose[:, :, 1:JOINTS]], dim=2),
    )


def _renamed(windows: Windows, which: Tensor) -> Windows:
    """Some frames (B,n) with left and right of input and truth swapped."""

    def pick(own: Tensor) -> Tensor:
        return torch.where(which.reshape(*which.shape, *[1] * (own.ndim - 2)), own[:, :, SWAP], own)

    return replace(
        windows,
        points=pick(windows.points),
        certainty=pick(windows.certainty),
        landmarks=pick(windows.landmarks),
        truth=pick(windows.truth),
        swapped=windows.swapped ^ which,
    )
