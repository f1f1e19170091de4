"""What the lifter reads, made from keypoints and 3D landmarks: numbers that depend neither on where in the picture a
person is, nor much on the focal length."""

import numpy as np
import torch
from jaxtyping import Float

from humanmm.models.geometry.projection import ray_axes, viewing_rays
from humanmm.models.geometry.rotations import unit
from humanmm.models.perception.interfaces import PersonFrames
from humanmm.models.perception.lifting.network import LifterInput

Array = np.ndarray

FARTHEST = 3.0
"""Keypoints farther from the crop's centre than this, in sides of the crop, are somewhere else."""
LEAST_CERTAINTY = 1e-3
"""Zero is for keypoints that nobody gave."""
SUREST, UNSUREST = 0.0026, 0.2
"""Expected errors, sides of the crop, of certainty 1 and 0."""
UNTOLD = 0.01
"""Where a pose network foretells no errors."""
_NEAREST = 0.1


def view_axes(centre: Float[Array, "n 2"], K: Float[Array, "*n 3 3"]) -> Float[Array, "n 3 3"]:
    """R_cam_view of each frame: z along the viewing ray through the crop's centre."""
    return ray_axes(unit(viewing_rays(centre[:, None], K)[:, 0]))


def points_in_view(
    pixels: Float[Array, "n k 2"],
    R_cam_view: Float[Array, "n 3 3"],
    size: Float[Array, " n"],
    K: Float[Array, "*n 3 3"],
) -> Float[Array, "n k 2"]:
    """Points of the picture about the viewing ray, in units of the crop's side."""
    rays = viewing_rays(pixels, K) @ R_cam_view
    flat = rays[..., :2] / np.maximum(rays[..., 2:], _NEAREST)
    return np.asarray(np.clip(flat / size[:, None, None], -FARTHEST, FARTHEST))


def lifter_input(frames: PersonFrames, K: Float[Array, "*n 3 3"]) -> LifterInput:
    """One person's frames as the network takes them (B = 1); K, one or one a frame, may be rough."""
    R_cam_view, size = view_axes(frames.centre, K), frames.side / K[..., 0, 0]
    side, sigma = frames.side[:, None], frames.keypoint_sigma
    of_side = np.full(frames.keypoints.shape[:2], UNTOLD) if sigma is None else sigma / side
    return LifterInput(
        time_s=batch_of_one(frames.time_s - frames.time_s[0]),
        exists=torch.ones(1, len(size), dtype=torch.bool),
        points=batch_of_one(points_in_view(frames.keypoints[..., :2].astype(np.float64), R_cam_view, size, K)),
        certainty=batch_of_one(certainty_of(of_side)),
        landmarks=batch_of_one(frames.landmarks3d),
        has_landmarks=torch.ones(1, len(size), dtype=torch.bool),
        size=batch_of_one(size),
    )


def certainty_of(of_side: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """How sure keypoints are, 1 to LEAST_CERTAINTY, by the logarithm of their expected errors in sides of the crop."""
    return np.asarray(np.clip(np.log(UNSUREST / of_side) / np.log(UNSUREST / SUREST), LEAST_CERTAINTY, 1))


def batch_of_one(array: Float[Array, "*n"]) -> Float[torch.Tensor, "1 *n"]:
    """The array as a float32 tensor with a first axis for people."""
    return torch.from_numpy(np.ascontiguousarray(array, dtype=np.float32))[None]
