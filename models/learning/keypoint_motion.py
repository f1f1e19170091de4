"""Motion capture as a detector of COCO's 17 keypoints sees it: windows for the keypoint lifter.

Nothing is rendered. Any take is seen by a random camera, and its keypoints have the errors of detectors: joints where
annotators put them, offsets that last, others that drift or tremble, limbs that are lost for a while.
"""

import functools
from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Float

from humanmm.models.geometry.projection import project
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.learning.other_motion import Take
from humanmm.models.learning.pairs import NEAREST_M, TEMPO
from humanmm.models.learning.windows import Windows, by_window
from humanmm.models.perception.lifting.features import certainty_of, points_in_view, view_axes
from humanmm.models.perception.lifting.keypoints import COCO, PLACED, crop_of
from humanmm.models.perception.regions import HEIGHT_OF_SIDE
from humanmm.models.records.landmarks import NUM_LANDMARKS, TORSO

Array = np.ndarray

FRAMES, STEPS_S = 32, (1 / 30, 1 / 15, 1 / 10, 1 / 7.5, 1 / 5)
"""Length of a window, and what may lie between its frames, seconds."""
FOCAL_PX = 1000.0
"""Of every camera: the network's input does not depend on it."""
DISTANCE_M = (1.8, 12.0)
"""Of cameras from people, evenly by its logarithm."""
PITCH_RAD, STEEP_PITCH_RAD, STEEP = (0.1, 0.2), (0.25, 0.4), 0.25
"""Mean and standard deviation of a camera's pitch (down), of others, and the fraction of these."""
ROLL_RAD, ANY_ROLL = 0.07, 0.07
"""Standard deviation of a camera's roll, and the fraction that has any: people stand on their hands."""
ORBITS, ORBIT_RAD_S = 0.4, 0.25
"""Fraction of the cameras that turn about the person, and how fast (standard deviation)."""
JOINT_M, SHOULDER_M, HIP_M = 0.012, 0.018, 0.022
"""Where annotators see a joint, standard deviation of each axis."""
HEIGHT_M, ERROR, ERROR_SPREAD = 1.7, 0.012, 0.5
"""A person's height; median error of keypoints, as a fraction of it, and standard deviation of its logarithm."""
LASTING, TREMBLING, DRIFTING = 0.5, 0.4, 0.35
"""Parts of that error: the window's, each frame's, and a random walk's after a third of a window."""
LOST_LIMBS = ((7, 9), (8, 10), (13, 15), (14, 16), (0, 1, 2, 3, 4), (11, 12, 13, 14, 15, 16))
LOST = (0.12, 0.12, 0.12, 0.12, 0.2, 0.06)
"""Limbs (COCO's numbers) that are lost for some frames, and in what fraction of the windows."""
LOST_POINT, LOST_MOMENT = 0.06, 0.02
"""Fractions of keypoints that are lost for a window, and for a frame."""
LOST_ERROR, SAID = 3.0, 0.28
"""How many times as large errors of lost keypoints are, and how many of these are left out by the detector."""
TOLD = 0.6
"""Fraction of the windows that come with expected errors, as those of BlazePose's heat maps."""
EXPECTED, OF_WINDOW, OF_POINT, OF_FRAME = 0.0088, 0.5, 0.35, 0.4
"""Median of these, as a fraction of a person's height, and standard deviations of their logarithm: the window's, each
keypoint's, each frame's (measured on rendered windows)."""
REAL = 1.65
"""Errors over those expected, before LASTING, TREMBLING and DRIFTING share them out: 1.2 times as large per axis."""
EXPECTED_LOST = (0.4, 1.8)
"""By how much the logarithm of expected errors grows where a keypoint is lost: less than its errors do, or more."""


class KeypointMotion:
    """Draws windows of takes; the same generator draws the same ones."""

    def __init__(self, takes: Sequence[Take]) -> None:
        self._takes = takes
        seconds = np.array([len(take.landmarks) / take.fps for take in takes])
        self._probability = seconds / seconds.sum()

    def draw(self, count: int, rng: np.random.Generator, frames: int = FRAMES) -> Windows:
        """So many windows of so many frames, of COCO's keypoints alone; left and right are as they are."""
        chosen = rng.choice(len(self._takes), size=count, p=self._probability)
        parts = [_part(self._takes[int(k)], frames, rng) for k in chosen]
        time_s, world, rotations, contacts = (np.stack(part) for part in zip(*parts, strict=True))
        R_cam_world, landmarks = _before_camera(time_s, world, rng)
        rotations[:, :, 0] = R_cam_world @ rotations[:, :, 0]
        pixels, sure = _detected(landmarks, rng)

        flat, K = landmarks.reshape(-1, NUM_LANDMARKS, 3), np.diag([FOCAL_PX, FOCAL_PX, 1.0])
        centre, side = crop_of(pixels.reshape(-1, len(COCO), 2), sure.reshape(-1, len(COCO)) >= PLACED)
        R_cam_view, size = view_axes(centre, K), side / FOCAL_PX
        points, certainty = np.zeros((*flat.shape[:2], 2)), np.zeros(flat.shape[:2])
        points[:, COCO] = points_in_view(pixels.reshape(-1, len(COCO), 2), R_cam_view, size, K)
        certainty[:, COCO] = sure.reshape(-1, len(COCO))
        truth = (flat - flat[:, [23, 24]].mean(axis=1, keepdims=True)) @ R_cam_view
        poses = rotations.reshape(len(flat), -1, 3, 3)
        poses[:, 0] = np.swapaxes(R_cam_view, -1, -2) @ poses[:, 0]
        tensor = functools.partial(by_window, num_windows=count)
        nothing = torch.zeros(count, frames, dtype=torch.bool)
        return Windows(
            time_s=torch.from_numpy(time_s.astype(np.float32)), exists=~nothing, points=tensor(points),
            certainty=tensor(certainty), landmarks=torch.zeros(count, frames, NUM_LANDMARKS, 3), size=tensor(size),
            truth=tensor(truth), pose=tensor(poses), swapped=nothing, clear=~nothing,
            contacts=torch.from_numpy(contacts.astype(np.float32)),
        )  # fmt: skip


def _part(take: Take, frames: int, rng: np.random.Generator) -> tuple[Array, Array, Array, Array]:
    """Times, landmarks, rotations and contacts of a part of a take, at some tempo."""
    time_s = np.arange(frames) * rng.choice(STEPS_S)
    at, last = time_s * rng.uniform(*TEMPO) * take.fps, len(take.landmarks) - 1
    room = last - at[-1]
    at = np.clip(at + (rng.uniform(0, room) if room > 0 else 0.0), 0, last - 1e-3)
    before, nearest = at.astype(int), np.rint(at).astype(int)
    fraction = (at - before)[:, None, None]
    landmarks = (1 - fraction) * take.landmarks[before] + fraction * take.landmarks[before + 1]
    return time_s, landmarks, take.rotations[nearest].astype(np.float64), take.contacts[nearest]


def _before_camera(
    time_s: Float[Array, "B n"], world: Float[Array, "B n 33 3"], rng: np.random.Generator
) -> tuple[Float[Array, "B n 3 3"], Float[Array, "B n 33 3"]]:
    """Rotations of random cameras (R_cam_world), and the landmarks in their axes."""
    B, n = time_s.shape
    orbit = rng.normal(0, ORBIT_RAD_S, (B, 1)) * (rng.random((B, 1)) < ORBITS)
    yaw = rng.uniform(-np.pi, np.pi, (B, 1)) + orbit * (time_s - time_s.mean(axis=1, keepdims=True))
    steep = rng.random((B, 1)) < STEEP
    pitch = np.where(steep, rng.normal(*STEEP_PITCH_RAD, (B, 1)), rng.normal(*PITCH_RAD, (B, 1)))
    any_roll = rng.random((B, 1)) < ANY_ROLL
    roll = np.where(any_roll, rng.uniform(-np.pi, np.pi, (B, 1)), rng.normal(0, ROLL_RAD, (B, 1)))

    def about(axis: int, angle: Float[Array, "B m"]) -> Float[Array, "B n 3 3"]:
        vectors = np.zeros((B, n, 3))
        vectors[..., axis] = angle
        return rotvec_to_rotmat(vectors)

    level = rotvec_to_rotmat(np.array([np.pi / 2, 0.0, 0.0]))  # the world's z is up, a camera's y is down
    R_cam_world = about(2, roll) @ about(0, -pitch) @ level @ about(2, yaw)
    centre = world[:, :, TORSO].mean(axis=(1, 2))
    landmarks = np.einsum("bnij,bnkj->bnki", R_cam_world, world - centre[:, None, None])
    nearest_m, farthest_m = DISTANCE_M
    distance = nearest_m * (farthest_m / nearest_m) ** rng.random(B)
    nearest = 2 * NEAREST_M - landmarks[..., 2].min(axis=(1, 2))
    landmarks[..., 2] += np.maximum(distance, nearest + NEAREST_M)[:, None, None]
    return R_cam_world, landmarks


def _detected(
    landmarks: Float[Array, "B n 33 3"], rng: np.random.Generator
) -> tuple[Float[Array, "B n 17 2"], Float[Array, "B n 17"]]:
    """COCO's keypoints as a detector has them, pixels, and how sure they are; 1 or 0 where it only names them."""
    B, n, k = (*landmarks.shape[:2], len(COCO))
    spread = np.full(k, JOINT_M)
    spread[[5, 6]], spread[[11, 12]] = SHOULDER_M, HIP_M
    joints = landmarks[:, :, COCO] + rng.normal(size=(B, 1, k, 3)) * spread[:, None]
    pixels = project(joints.reshape(-1, k, 3), np.diag([FOCAL_PX, FOCAL_PX, 1.0]), near_m=NEAREST_M)
    height = HEIGHT_M * FOCAL_PX / landmarks[..., 2].mean(axis=(1, 2))
    is_told = rng.random((B, 1, 1)) < TOLD
    unsaid = np.exp(rng.normal(np.log(ERROR), ERROR_SPREAD, (B, 1, 1)))
    spread = OF_WINDOW * rng.normal(size=(B, 1, 1)) + OF_POINT * rng.normal(size=(B, 1, k))
    expected = EXPECTED * np.exp(spread + OF_FRAME * rng.normal(size=(B, n, k)))
    walk = np.cumsum(rng.normal(size=(B, n, k, 2)), axis=1) / np.sqrt(n / 3)
    error = LASTING * rng.normal(size=(B, 1, k, 2)) + TREMBLING * rng.normal(size=(B, n, k, 2)) + DRIFTING * walk
    lost = (rng.random((B, 1, k)) < LOST_POINT) | (rng.random((B, n, k)) < LOST_MOMENT)
    frame = np.arange(n)
    for limb, fraction in zip(LOST_LIMBS, LOST, strict=True):
        first, length = rng.integers(0, n, (B, 1)), rng.integers(3, n, (B, 1))
        run = (rng.random((B, 1)) < fraction) & (frame >= first) & (frame < first + length)
        lost[..., limb] |= run[..., None]
    scale = np.where(is_told, REAL * expected, unsaid) * np.where(lost, LOST_ERROR, 1.0)
    error *= height[:, None, None, None] * scale[..., None]
    expected = expected * np.exp(np.where(lost, rng.uniform(*EXPECTED_LOST, (B, 1, k)), 0.0))
    sure = certainty_of(HEIGHT_OF_SIDE * expected)
    named = ~(lost & (rng.random((B, n, k)) < SAID))
    return pixels.reshape(B, n, k, 2) + error, np.where(is_told, sure, named)
