"""3D landmarks for people of whom a detector gives only COCO's 17 keypoints in the picture.

A small network (two residual blocks on the keypoints of seven moments about a frame, `scripts/train_keypoint_lifter`,
model card weights/keypoint_lifter.md) predicts the output of the pose network: 33 landmarks in metres about the
mid-hip. It is rougher than a network that sees the picture; `PersonTrack.lifted` marks its tracks. It gets which
keypoints are seen, not their scores.
"""

from functools import lru_cache

import numpy as np
import torch
from jaxtyping import Float
from safetensors.torch import load

from humanmm.models.geometry.rotations import swing
from humanmm.models.perception.interfaces import SEEN
from humanmm.models.records.landmarks import COCO_LANDMARKS
from humanmm.models.weights.shipped import read_weights

Array = np.ndarray

TORSO = (5, 6, 11, 12)
"""COCO's shoulders and hips."""
OFFSETS_S = (-1 / 3, -2 / 15, -1 / 15, 0.0, 1 / 15, 2 / 15, 1 / 3)
"""Moments that the network looks at, seconds from the frame."""
_CHUNK_FRAMES = 512


class KeypointLiftingNetwork(torch.nn.Module):
    """(n, inputs) of `features` → (n,33,3) landmarks about the mid-hip.

    Metres, in axes parallel to the torso's viewing ray. Residual blocks h ← h + V relu(norm(U h)) between two linear
    layers.
    """

    def __init__(self, hidden: int = 384, blocks: int = 2) -> None:
        super().__init__()
        self.inward = torch.nn.Linear(len(OFFSETS_S) * len(COCO_LANDMARKS) * 3, hidden)
        self.u = torch.nn.ModuleList(torch.nn.Linear(hidden, hidden) for _ in range(blocks))
        self.v = torch.nn.ModuleList(torch.nn.Linear(hidden, hidden) for _ in range(blocks))
        self.outward = torch.nn.Linear(hidden, 33 * 3)

    def forward(self, inputs: torch.Tensor) -> torch.Tensor:
        """Landmarks of every row."""
        h = torch.relu(self.inward(inputs))
        for u, v in zip(self.u, self.v, strict=True):
            h = h + v(torch.relu(torch.nn.functional.layer_norm(u(h), h.shape[-1:])))
        landmarks: torch.Tensor = self.outward(h).reshape(-1, 33, 3)
        return landmarks


def lift_keypoints(
    keypoints: Float[Array, "n 17 3"], time_s: Float[Array, " n"], K: Float[Array, "3 3"]
) -> Float[Array, "n 33 3"]:
    """3D landmarks of one person's keypoints, by the shipped network (a `KeypointLifter`)."""
    network = load_keypoint_lifter()
    rays = (keypoints[..., :2] - K[:2, 2]) / np.diagonal(K)[:2]
    seen = keypoints[..., 2] >= SEEN
    lifted = np.empty((len(keypoints), 33, 3))
    for start in range(0, len(keypoints), _CHUNK_FRAMES):
        rows = slice(start, start + _CHUNK_FRAMES)
        moments = np.clip(time_s[rows, None] + np.array(OFFSETS_S), time_s[0], time_s[-1])
        at = np.searchsorted(time_s, moments.ravel() + 1e-6).reshape(moments.shape)
        nearest = np.clip(at, 1, len(time_s)) - 1  # the last frame not after the moment
        inputs, R_cam_torso = features(rays[nearest], seen[nearest])
        with torch.inference_mode():
            found = network(torch.from_numpy(inputs.astype(np.float32))).numpy()
        lifted[rows] = found.astype(np.float64) @ np.swapaxes(R_cam_torso, -1, -2)
    return lifted


def features(
    rays: Float[Array, "n moments 17 2"], seen: Array
) -> tuple[Float[Array, "n inputs"], Float[Array, "n 3 3"]]:
    """The network's inputs, and the axes of its output (R_cam_torso, of the middle moment).

    Every moment's rays are rotated until the torso lies straight ahead, and brought to one size over all moments: the
    output depends neither on where in the picture a person is, nor on the focal length. Unseen keypoints are zero.
    """
    weight = np.zeros(seen.shape)
    weight[..., TORSO] = seen[..., TORSO]
    weight = np.where(weight.any(axis=-1, keepdims=True), weight, seen)
    total = np.maximum(weight.sum(axis=-1), 1e-9)
    centre = np.einsum("ntk,ntkc->ntc", weight, rays) / total[..., None]
    towards = np.concatenate([centre, np.ones((*centre.shape[:2], 1))], axis=-1)
    R_cam_torso = swing(np.broadcast_to([0.0, 0.0, 1.0], towards.shape), towards)
    rotated = np.concatenate([rays, np.ones((*rays.shape[:-1], 1))], axis=-1) @ R_cam_torso
    flat = rotated[..., :2] / np.maximum(rotated[..., 2:], 0.1) * seen[..., None]
    size = np.sqrt((flat**2).sum(axis=(1, 2, 3)) / np.maximum(seen.sum(axis=(1, 2)), 1))
    flat = flat / np.maximum(size, 1e-6)[:, None, None, None]
    inputs = np.concatenate([flat, seen[..., None]], axis=-1).reshape(len(rays), -1)
    return inputs, R_cam_torso[:, len(OFFSETS_S) // 2]


@lru_cache(maxsize=1)
def load_keypoint_lifter() -> KeypointLiftingNetwork:
    """The shipped network, checked against its sha256."""
    network = KeypointLiftingNetwork()
    network.load_state_dict(load(read_weights("keypoint_lifter.safetensors")))
    return network.eval()
