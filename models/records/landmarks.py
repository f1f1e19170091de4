"""The 33 body landmarks of the pose network: names, pairs, which of them COCO names."""

import numpy as np

NAMES: tuple[str, ...] = (
    "nose",
    "left_eye_inner", "left_eye", "left_eye_outer", "right_eye_inner", "right_eye", "right_eye_outer",
    "left_ear", "right_ear", "mouth_left", "mouth_right",
    "left_shoulder", "right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist",
    "left_pinky", "right_pinky", "left_index", "right_index", "left_thumb", "right_thumb",
    "left_hip", "right_hip", "left_knee", "right_knee", "left_ankle", "right_ankle",
    "left_heel", "right_heel", "left_foot_index", "right_foot_index",
)  # fmt: skip

NUM_LANDMARKS = len(NAMES)
INDEX: dict[str, int] = {name: i for i, name in enumerate(NAMES)}


def _counterpart(name: str) -> str:
    if "left" in name:
        return name.replace("left", "right")
    return name.replace("right", "left")


SWAP = np.array([INDEX[_counterpart(name)] for name in NAMES])
"""SWAP[k] is landmark k's counterpart on the other side: `keypoints[SWAP]` swaps left and right."""

VISIBLE = 0.5
"""Visibility from which on a landmark counts as seen."""
SHOULDERS = (INDEX["left_shoulder"], INDEX["right_shoulder"])
WRISTS = (INDEX["left_wrist"], INDEX["right_wrist"])
HIPS = (INDEX["left_hip"], INDEX["right_hip"])
TORSO = (*SHOULDERS, *HIPS)
KNEES = (INDEX["left_knee"], INDEX["right_knee"])
ANKLES = (INDEX["left_ankle"], INDEX["right_ankle"])

LIMBS = tuple(
    INDEX[f"{side}_{joint}"]
    for joint in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
    for side in ("left", "right")
)
"""The 12 landmarks that carry the body's pose: shoulders, elbows, wrists, hips, knees, ankles."""

BEYOND: dict[int, tuple[int, ...]] = {
    INDEX[f"{side}_{joint}"]: tuple(INDEX[f"{side}_{end}"] for end in ends)
    for joint, ends in (("wrist", ("pinky", "index", "thumb")), ("ankle", ("heel", "foot_index")))
    for side in ("left", "right")
}
"""The landmarks of the hand beyond each wrist, and of the foot beyond each ankle."""

COCO_LANDMARKS = (0, 2, 5, 7, 8, 11, 12, 13, 14, 15, 16, 23, 24, 25, 26, 27, 28)
"""Of COCO's 17 keypoints, in their order, the landmark with the same name."""
COCO_SHOULDERS, COCO_HIPS = (5, 6), (11, 12)
COCO_NAMES = tuple(NAMES[k] for k in COCO_LANDMARKS)
COCO_SWAP = np.array([COCO_LANDMARKS.index(SWAP[k]) for k in COCO_LANDMARKS])
"""As SWAP, of COCO's keypoints."""
COCO_LIMBS = tuple(COCO_LANDMARKS.index(k) for k in LIMBS)
"""Of LIMBS, in their order, COCO's keypoint."""


def with_sides_swapped(points: np.ndarray, is_swapped: np.ndarray, swap: np.ndarray = SWAP) -> np.ndarray:
    """Keypoints or landmarks (n,33,c), or a number of each (n,33), with the names of left and right swapped in the
    marked frames (n,) bool; COCO's keypoints (n,17,c) with `swap` COCO_SWAP.

    The points stay where they are: mirroring the depths as well was measured to be worse.
    """
    return np.where(is_swapped.reshape(-1, *[1] * (points.ndim - 1)), points[:, swap], points)
