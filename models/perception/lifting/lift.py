"""The shipped lifters: landmarks in space and joint rotations of everybody, from what the pose networks saw.

A pose network looks at one picture: it misses half of a camera's pitch, leans bodies towards it and guesses limbs anew
in every frame. The lifter has seen what these networks say of rendered people whose pose is known (model card
weights/lifter.md), and looks at a second before and after each frame. What the keypoint lifter (`keypoints`) says has
other errors: it has seen no pose network.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.geometry.rotations import nearest_rotation, rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.perception.interfaces import SEEN, Lifted, PersonFrames
from humanmm.models.perception.lifting.features import certainty_of, lifter_input, view_axes
from humanmm.models.perception.lifting.keypoints import COCO, PLACED, read_keypoints
from humanmm.models.perception.lifting.network import LifterNetwork
from humanmm.models.perception.lifting.reading import Reading, load_lifter, read_in_pieces
from humanmm.models.records.landmarks import BEYOND, COCO_LANDMARKS, HIPS, NUM_LANDMARKS, with_sides_swapped
from humanmm.models.records.tracks import UNKNOWN_RAD, PoseEstimates

Array = np.ndarray

POSE_NETWORK, LIFTER, WHOLE_LIFTER, KEYPOINT_LIFTER = 0.1, 0.3, 0.3, 0.3
"""Shares of the landmarks (measured: docs/measurements/networks.md). On rendered people the pose network has nothing to
say that the lifters do not know better, on real ones it has."""


def lift(frames: PersonFrames, K: Float[Array, "3 3"]) -> Lifted:
    """Landmarks and joint rotations of one person, by the shipped networks (a `Lifter`).

    Landmarks are a mean of what all four say; of fingers, toes and face, which the keypoint lifter does not see, they
    move as its wrists, ankles and nose do. Rotations of joints are halfway between the whole lifter's and the keypoint
    lifter's: bodies posed by them are nearly as near to the truth as these networks' landmarks, those of the lifter are
    not. The root's is halfway between the lifter's and the whole lifter's.
    """

    def read_by(network: LifterNetwork) -> Reading:
        return read_in_pieces(network, frames.time_s, lambda seen: lifter_input(frames.chosen(seen), K))

    found = read_by(load_lifter("lifter.safetensors"))
    whole = read_by(load_lifter("whole_lifter.safetensors"))
    keypoints = _from_keypoints(frames, found.pose.swap_odds > 0, K)
    shares = (POSE_NETWORK, LIFTER, WHOLE_LIFTER)
    with_pictures = (frames.landmarks3d, found.landmarks3d, whole.landmarks3d)
    seen = sum(share * _about_hips(one) for share, one in zip(shares, with_pictures, strict=True)) / sum(shares)
    moved = KEYPOINT_LIFTER * (keypoints.landmarks3d - seen)[:, COCO]
    pose = PoseEstimates(
        np.concatenate([
            _halfway(found.pose.vectors[:, :1], whole.pose.vectors[:, :1]),
            _halfway(whole.pose.vectors[:, 1:], keypoints.pose.vectors[:, 1:]),
        ], axis=1),
        np.concatenate([
            (found.pose.sigma + whole.pose.sigma)[:, :1] / 2,
            np.maximum(whole.pose.sigma, keypoints.pose.sigma)[:, 1:],
        ], axis=1),
        found.pose.swap_odds,
    )  # fmt: skip
    return Lifted((seen + moved[:, _MOVED_WITH]).astype(np.float32), pose)


def _halfway(a: Float[Array, "*n 3"], b: Float[Array, "*n 3"]) -> Float[Array, "*n 3"]:
    """The rotations between two, as vectors."""
    R_a, R_b = rotvec_to_rotmat(a.astype(np.float64)), rotvec_to_rotmat(b.astype(np.float64))
    return np.asarray(rotmat_to_rotvec(nearest_rotation(R_a + R_b)), np.float32)


def _from_keypoints(frames: PersonFrames, are_swapped: Bool[Array, " n"], K: Float[Array, "3 3"]) -> Reading:
    """Landmarks about the hips (view axes) and joints by the keypoint lifter, sides named as they are given.

    Keypoints whose sides the lifter holds for swapped are put right for it: keypoints alone, with left and right
    swapped, are those of a body that turns its back, and it would be turned round. Of such frames it knows no
    rotations: they would be those of a body that is not there.
    """
    if frames.keypoint_sigma is None:
        is_seen = frames.keypoints[..., 2] >= SEEN
    else:
        is_seen = certainty_of(frames.keypoint_sigma / frames.side[:, None]) >= PLACED
    keypoints = np.concatenate([frames.keypoints[..., :2], is_seen[..., None]], axis=-1)
    found = read_keypoints(with_sides_swapped(keypoints, are_swapped)[:, COCO], frames.time_s, K)
    landmarks = with_sides_swapped(found.landmarks3d @ view_axes(frames.centre, K), are_swapped)
    sigma = np.where(are_swapped[:, None], np.float32(UNKNOWN_RAD), found.pose.sigma)
    return Reading(_about_hips(landmarks), replace(found.pose, sigma=sigma))


def _about_hips(landmarks: Float[Array, "n 33 3"]) -> Float[Array, "n 33 3"]:
    return np.asarray(landmarks - landmarks[:, list(HIPS)].mean(axis=1, keepdims=True))


def _joints_moved_with() -> list[int]:
    """Of every landmark, which of COCO's keypoints it moves with: itself, else the wrist, the ankle or the nose."""
    of_end = {end: joint for joint, ends in BEYOND.items() for end in ends}
    named = [k if k in COCO_LANDMARKS else of_end.get(k, COCO_LANDMARKS[0]) for k in range(NUM_LANDMARKS)]
    return [COCO_LANDMARKS.index(k) for k in named]


_MOVED_WITH = _joints_moved_with()
