"""The shipped lifters: landmarks in space and joint rotations of everybody, from what the pose networks saw.

A pose network looks at one picture: it misses half of a camera's pitch, leans bodies towards it and guesses limbs anew
in every frame. The lifter has seen what these networks say of rendered people whose pose is known (model card
weights/lifter.md), and looks at a second before and after each frame. What the keypoint lifter (`keypoints`) says has
other errors: it has seen far more motion, and no pose network's landmarks.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.perception.interfaces import Lifted, PersonFrames
from humanmm.models.perception.lifting.features import lifter_input, view_axes
from humanmm.models.perception.lifting.keypoints import COCO, read_keypoints
from humanmm.models.perception.lifting.reading import Reading, load_lifter, read_in_pieces
from humanmm.models.perception.regions import HEIGHT_OF_SIDE
from humanmm.models.records.landmarks import BEYOND, COCO_LANDMARKS, HIPS, NUM_LANDMARKS, with_sides_swapped
from humanmm.models.records.tracks import UNKNOWN_RAD, PoseEstimates

Array = np.ndarray

POSE_NETWORK, LIFTER, KEYPOINT_LIFTER = 0.2, 0.4, 0.4
"""Shares of the landmarks (measured: docs/measurements/networks.md). On rendered people the pose network has nothing to
say that the lifters do not know better, on real ones it has."""

PLACED = 0.04
"""Expected error, as a fraction of the height, up to which a keypoint counts as seen for the keypoint lifter; 0.06 and
0.1 are as good, visibility is worse by 3 to 6 % (docs/measurements/perception.md)."""


def lift(frames: PersonFrames, K: Float[Array, "3 3"]) -> Lifted:
    """Landmarks and joint rotations of one person, by the shipped networks (a `Lifter`).

    Landmarks are a mean of what all three say; of fingers, toes and face, which the keypoint lifter does not see, they
    move as its wrists, ankles and nose do. Rotations of joints are the keypoint lifter's: bodies posed by them are
    nearly as near to the truth as its landmarks, those of the lifter are not. The root's, with its expected error, is
    the lifter's, whom the picture tells front from back.
    """
    lifter = load_lifter("lifter.safetensors")
    found = read_in_pieces(lifter, frames.time_s, lambda seen: lifter_input(frames.chosen(seen), K))
    from_keypoints, joints = _from_keypoints(frames, found.pose.swap_odds > 0, K)
    seen, lifted = _about_hips(frames.landmarks3d), _about_hips(found.landmarks3d)
    both = (POSE_NETWORK * seen + LIFTER * lifted) / (POSE_NETWORK + LIFTER)
    moved = KEYPOINT_LIFTER * (from_keypoints - both)[:, COCO]
    pose = PoseEstimates(
        np.concatenate([found.pose.vectors[:, :1], joints.vectors[:, 1:]], axis=1),
        np.concatenate([found.pose.sigma[:, :1], joints.sigma[:, 1:]], axis=1),
        found.pose.swap_odds,
    )
    return Lifted((both + moved[:, _MOVED_WITH]).astype(np.float32), pose)


def _from_keypoints(frames: PersonFrames, are_swapped: Bool[Array, " n"], K: Float[Array, "3 3"]) -> Reading:
    """Landmarks about the hips (view axes) and joints by the keypoint lifter, sides named as they are given.

    Keypoints whose sides the lifter holds for swapped are put right for it: keypoints alone, with left and right
    swapped, are those of a body that turns its back, and it would be turned round. Of such frames it knows no
    rotations: they would be those of a body that is not there.
    """
    keypoints = frames.keypoints
    if frames.keypoint_sigma is not None:
        is_placed = frames.keypoint_sigma < PLACED * HEIGHT_OF_SIDE * frames.side[:, None]
        keypoints = np.concatenate([keypoints[..., :2], is_placed[..., None]], axis=-1)
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
