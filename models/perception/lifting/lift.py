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
from humanmm.models.perception.lifting.reading import Reading, load_lifter, read_in_pieces, with_sides_put_right
from humanmm.models.records.landmarks import BEYOND, COCO_LANDMARKS, HIPS, NUM_LANDMARKS, with_sides_swapped
from humanmm.models.records.tracks import PoseEstimates

Array = np.ndarray

POSE_NETWORK, LIFTER, KEYPOINT_LIFTER = 0.15, 0.45, 0.4
"""Shares of the landmarks (measured: docs/measurements/networks.md). On rendered people the pose network has nothing to
say that the lifters do not know better, on real ones it has."""


def lift(frames: PersonFrames, K: Float[Array, "3 3"], *, network: LifterNetwork | None = None) -> Lifted:
    """Landmarks and joint rotations of one person, by the shipped networks, or another lifter's (a `Lifter`).

    Landmarks are a mean of what all three say; of fingers, toes and face, which the keypoint lifter does not see, they
    move as its wrists, ankles and nose do. Rotations of joints are halfway between the lifters', the root's is the
    lifter's. Where the lifter holds left and right for swapped both look at them put right.
    """
    lifter = network or load_lifter("lifter.safetensors")

    def read(are_swapped: Bool[Array, " n"]) -> Reading:
        named = frames.with_sides_swapped(are_swapped)
        return read_in_pieces(lifter, frames.time_s, lambda rows: lifter_input(named.chosen(rows), K))

    found = with_sides_put_right(read, len(frames.time_s))
    keypoints = _from_keypoints(frames, found.pose.swap_odds > 0, K)
    share = POSE_NETWORK / (POSE_NETWORK + LIFTER)
    seen = share * _about_hips(frames.landmarks3d) + (1 - share) * _about_hips(found.landmarks3d)
    moved = KEYPOINT_LIFTER * (keypoints.landmarks3d - seen)[:, COCO]
    of_root, of_joints = slice(0, 1), slice(1, None)
    vectors = _halfway(found.pose.vectors[:, of_joints], keypoints.pose.vectors[:, of_joints])
    sigma = np.maximum(found.pose.sigma, keypoints.pose.sigma)[:, of_joints]
    pose = PoseEstimates(
        np.concatenate([found.pose.vectors[:, of_root], vectors], axis=1),
        np.concatenate([found.pose.sigma[:, of_root], sigma], axis=1),
        found.pose.swap_odds,
    )
    return Lifted((seen + moved[:, _MOVED_WITH]).astype(np.float32), pose)


def _halfway(a: Float[Array, "*n 3"], b: Float[Array, "*n 3"]) -> Float[Array, "*n 3"]:
    """The rotations between two, as vectors."""
    R_a, R_b = rotvec_to_rotmat(a.astype(np.float64)), rotvec_to_rotmat(b.astype(np.float64))
    return np.asarray(rotmat_to_rotvec(nearest_rotation(R_a + R_b)), np.float32)


def _from_keypoints(frames: PersonFrames, are_swapped: Bool[Array, " n"], K: Float[Array, "3 3"]) -> Reading:
    """Landmarks about the hips (view axes) and joints by the keypoint lifter, sides named as they are given.

    Sides that the lifter holds for swapped are put right for it; where it then holds them for swapped itself, it says
    nothing of the lifter's body.
    """
    if frames.keypoint_sigma is None:
        is_seen = frames.keypoints[..., 2] >= SEEN
    else:
        is_seen = certainty_of(frames.keypoint_sigma / frames.side[:, None]) >= PLACED
    keypoints = np.concatenate([frames.keypoints[..., :2], is_seen[..., None]], axis=-1)
    found = read_keypoints(with_sides_swapped(keypoints, are_swapped)[:, COCO], frames.time_s, K)
    landmarks = with_sides_swapped(found.landmarks3d @ view_axes(frames.centre, K), are_swapped)
    return Reading(_about_hips(landmarks), replace(found.pose, sigma=found.pose.sigma_as_named))


def _about_hips(landmarks: Float[Array, "n 33 3"]) -> Float[Array, "n 33 3"]:
    return np.asarray(landmarks - landmarks[:, list(HIPS)].mean(axis=1, keepdims=True))


def _joints_moved_with() -> list[int]:
    """Of every landmark, which of COCO's keypoints it moves with: itself, else the wrist, the ankle or the nose."""
    of_end = {end: joint for joint, ends in BEYOND.items() for end in ends}
    named = [k if k in COCO_LANDMARKS else of_end.get(k, COCO_LANDMARKS[0]) for k in range(NUM_LANDMARKS)]
    return [COCO_LANDMARKS.index(k) for k in named]


_MOVED_WITH = _joints_moved_with()
