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
LEAST_VISIBILITY = 1e-3
"""Zero is for keypoints that nobody gave."""
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
    visibility = np.clip(frames.keypoints[..., 2], LEAST_VISIBILITY, 1)
    return LifterInput(
        time_s=batch_of_one(frames.time_s - frames.time_s[0]),
        exists=torch.ones(1, len(size), dtype=torch.bool),
        points=batch_of_one(points_in_view(frames.keypoints[..., :2].astype(np.float64), R_cam_view, size, K)),
        visibility=batch_of_one(visibility),
        landmarks=batch_of_one(frames.landmarks3d),
        has_landmarks=torch.ones(1, len(size), dtype=torch.bool),
        size=batch_of_one(size),
    )


def batch_of_one(array: Float[Array, "*n"]) -> Float[torch.Tensor, "1 *n"]:
    """The array as a float32 tensor with a first axis for people."""
    return torch.from_numpy(np.ascontiguousarray(array, dtype=np.float32))[None]
