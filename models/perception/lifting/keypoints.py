"""3D landmarks for people of whom a detector gives only COCO's 17 keypoints in the picture.

A network like the lifter's (`lifting.network`), trained on motion capture as such detectors see it
(`learning.keypoint_motion`, model card weights/keypoint_lifter.md), predicts the 33 landmarks in metres about the
mid-hip. It is rougher than networks that see the picture; `PersonTrack.lifted` marks its tracks. It gets which
keypoints are seen, not their scores.
"""

import numpy as np
import torch
from jaxtyping import Bool, Float

from humanmm.models.perception.interfaces import SEEN, Lifted
from humanmm.models.perception.lifting.features import batch_of_one, points_in_view, view_axes
from humanmm.models.perception.lifting.lifted import with_root_rotated
from humanmm.models.perception.lifting.network import LifterInput, LifterNetwork
from humanmm.models.perception.lifting.reading import Reading, load_lifter, read_in_pieces, with_sides_put_right
from humanmm.models.records.landmarks import COCO_LANDMARKS, COCO_SWAP, NUM_LANDMARKS, TORSO, with_sides_swapped

Array = np.ndarray

COCO = list(COCO_LANDMARKS)
"""The landmarks that COCO names, in its order."""
PLACED = 0.48
"""Certainty (`features.certainty_of`) from which a keypoint has a say in where the crop lies: an expected error of 0.04
of the person's height; 0.06 and 0.1 are as good (docs/measurements/perception.md)."""
CROP = 5.0
"""Side of the crop, in root mean square distances of the keypoints from its centre."""
_TORSO = [COCO.index(landmark) for landmark in TORSO]


def lift_keypoints(keypoints: Float[Array, "n 17 3"], time_s: Float[Array, " n"], K: Float[Array, "3 3"]) -> Lifted:
    """One person's landmarks and joint rotations, by the shipped network (a `KeypointLifter`)."""
    seen = keypoints[..., 2:] >= SEEN
    return Lifted(*read_keypoints(np.concatenate([keypoints[..., :2], seen], axis=-1), time_s, K))


def read_keypoints(keypoints: Float[Array, "n 17 3"], time_s: Float[Array, " n"], K: Float[Array, "3 3"]) -> Reading:
    """What the shipped network says, camera axes; of every keypoint x, y and how sure it is: 1 or 0 for seen or not.

    Where it holds left and right for swapped it looks again with them put right.
    """
    network = load_lifter("keypoint_lifter.safetensors")

    def read(are_swapped: Bool[Array, " n"]) -> Reading:
        return _seen_by(network, with_sides_swapped(keypoints, are_swapped, COCO_SWAP), time_s, K)

    return with_sides_put_right(read, len(keypoints))


def _seen_by(
    network: LifterNetwork, keypoints: Float[Array, "n 17 3"], time_s: Float[Array, " n"], K: Float[Array, "3 3"]
) -> Reading:
    R_cam_view, size = views_of(keypoints, K)

    def given(frames: slice) -> LifterInput:
        return keypoint_input(keypoints[frames], time_s[frames], K, R_cam_view[frames], size[frames])

    found = read_in_pieces(network, time_s, given)
    landmarks = found.landmarks3d.astype(np.float64) @ np.swapaxes(R_cam_view, -1, -2)
    return Reading(landmarks, with_root_rotated(found.pose, R_cam_view))


def views_of(
    keypoints: Float[Array, "n 17 3"], K: Float[Array, "3 3"]
) -> tuple[Float[Array, "n 3 3"], Float[Array, " n"]]:
    """Of each frame: R_cam_view, z along the ray through the crop's centre; the crop's side over the focal length."""
    centre, side = crop_of(keypoints[..., :2], keypoints[..., 2] >= PLACED)
    return view_axes(centre, K), side / K[0, 0]


def keypoint_input(
    keypoints: Float[Array, "n 17 3"],
    time_s: Float[Array, " n"],
    K: Float[Array, "3 3"],
    R_cam_view: Float[Array, "n 3 3"],
    size: Float[Array, " n"],
) -> LifterInput:
    """One person's keypoints as the network takes them (B = 1); `R_cam_view` and `size` are those of `views_of`."""
    n = len(keypoints)
    points, certainty = np.zeros((n, NUM_LANDMARKS, 2)), np.zeros((n, NUM_LANDMARKS))
    points[:, COCO] = points_in_view(keypoints[..., :2].astype(np.float64), R_cam_view, size, K)
    certainty[:, COCO] = keypoints[..., 2]
    every = torch.ones(1, n, dtype=torch.bool)
    return LifterInput(
        time_s=batch_of_one(time_s - time_s[0]),
        exists=every,
        points=batch_of_one(points),
        certainty=batch_of_one(certainty),
        landmarks=torch.zeros(1, n, NUM_LANDMARKS, 3),
        has_landmarks=~every,
        size=batch_of_one(size),
    )


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
