"""3D landmarks for people of whom a detector gives only COCO's 17 keypoints in the picture.

A network like the lifter's (`lifting.network`), trained on motion capture as such detectors see it
(`learning.keypoint_motion`, model card weights/keypoint_lifter.md), predicts the 33 landmarks in metres about the
mid-hip. It is rougher than networks that see the picture; `PersonTrack.lifted` marks its tracks. It gets which
keypoints are seen, not their scores.
"""

from functools import lru_cache

import numpy as np
import torch
from jaxtyping import Bool, Float
from safetensors.torch import load

from humanmm.models.perception.interfaces import SEEN
from humanmm.models.perception.lifting.features import points_in_view, view_axes
from humanmm.models.perception.lifting.lift import pieces
from humanmm.models.perception.lifting.network import LifterInput, LifterNetwork
from humanmm.models.records.landmarks import COCO_LANDMARKS, NUM_LANDMARKS, TORSO
from humanmm.models.weights.shipped import read_weights

Array = np.ndarray

COCO = list(COCO_LANDMARKS)
"""The landmarks that COCO names, in its order."""
CROP = 5.0
"""Side of the crop, in root mean square distances of the keypoints from its centre."""
_TORSO = [COCO.index(landmark) for landmark in TORSO]


def lift_keypoints(
    keypoints: Float[Array, "n 17 3"], time_s: Float[Array, " n"], K: Float[Array, "3 3"]
) -> Float[Array, "n 33 3"]:
    """3D landmarks of one person's keypoints, by the shipped network (a `KeypointLifter`)."""
    network = load_keypoint_lifter()
    lifted = np.empty((len(keypoints), NUM_LANDMARKS, 3))
    for own, seen in pieces(time_s, network.reach_s):
        given, R_cam_view = keypoint_input(keypoints[seen], time_s[seen], K)
        with torch.inference_mode():
            found = network(given).landmarks[0].numpy().astype(np.float64)
        in_camera = found @ np.swapaxes(R_cam_view, -1, -2)
        lifted[own] = in_camera[own.start - seen.start : own.stop - seen.start]
    return lifted


def keypoint_input(
    keypoints: Float[Array, "n 17 3"], time_s: Float[Array, " n"], K: Float[Array, "3 3"]
) -> tuple[LifterInput, Float[Array, "n 3 3"]]:
    """One person's keypoints as the network takes them (B = 1), and the axes of its output (R_cam_view)."""
    seen = keypoints[..., 2] >= SEEN
    centre, side = crop_of(keypoints[..., :2], seen)
    R_cam_view, size = view_axes(centre, K), side / K[0, 0]
    n = len(keypoints)
    points, visibility = np.zeros((n, NUM_LANDMARKS, 2)), np.zeros((n, NUM_LANDMARKS))
    points[:, COCO] = points_in_view(keypoints[..., :2].astype(np.float64), R_cam_view, size, K)
    visibility[:, COCO] = seen

    def tensor(array: Array) -> torch.Tensor:
        return torch.from_numpy(np.ascontiguousarray(array, dtype=np.float32))[None]

    every = torch.ones(1, n, dtype=torch.bool)
    landmarks = torch.zeros(1, n, NUM_LANDMARKS, 3)
    given = LifterInput(
        tensor(time_s - time_s[0]), every, tensor(points), tensor(visibility), landmarks, ~every, tensor(size)
    )
    return given, R_cam_view


def crop_of(
    pixels: Float[Array, "n 17 2"], seen: Bool[Array, "n 17"]
) -> tuple[Float[Array, "n 2"], Float[Array, " n"]]:
    """Centre and side of the square about a person: the torso, where any of it is seen, and how far all spread."""
    weight = np.zeros(seen.shape)
    weight[:, _TORSO] = seen[:, _TORSO]
    weight = np.where(weight.any(axis=1, keepdims=True), weight, seen)
    weight /= np.maximum(weight.sum(axis=1, keepdims=True), 1.0)
    centre = np.einsum("nk,nkc->nc", weight, pixels)
    squared = np.sum((pixels - centre[:, None]) ** 2, axis=-1) * seen
    spread = np.sqrt(squared.sum(axis=1) / np.maximum(seen.sum(axis=1), 1))
    return centre, CROP * np.maximum(spread, 1.0)


@lru_cache(maxsize=1)
def load_keypoint_lifter() -> LifterNetwork:
    """The shipped network, checked against its sha256."""
    network = LifterNetwork()
    weights = load(read_weights("keypoint_lifter.safetensors"))
    network.load_state_dict({name: value.float() for name, value in weights.items()})
    return network.eval()
