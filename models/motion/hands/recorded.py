"""A person's fingers in every frame of the recording, from what was seen of his hands in all shots.

The wrist is bent so that the palm lies as the hand network sees it: the body's own landmarks of a hand are only three.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from humanmm.models.body.body24 import load_body
from humanmm.models.body.fingers import WRISTS
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.geometry.projection import ray_axes, viewing_rays
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat, unit
from humanmm.models.motion.hands.finger_joints import AT_EASE, hand_pose
from humanmm.models.motion.hands.lifting import finger_angles, palm_rotation
from humanmm.models.motion.hands.over_time import over_time
from humanmm.models.records.motion import PersonMotion, WorldMotion
from humanmm.models.records.shots import Shot
from humanmm.models.records.tracks import PersonTrack

Array = np.ndarray

LARGEST_WRIST_CHANGE = np.deg2rad(90)
"""A palm that lies more than this from where the body has it is not believed."""
_OF_ANGLES = slice(0, AT_EASE.size)
_OF_WRIST = slice(AT_EASE.size, AT_EASE.size + 3)


@dataclass(frozen=True, eq=False)
class RecordedHands:
    """What hands add to a person of N frames."""

    body_pose: Float[Array, "N 23 3"]
    """The person's, its wrists bent."""
    hand_pose: Float[Array, "N 30 3"]
    confidence: Float[Array, "N 2"]


def recorded_hands(
    person: PersonMotion,
    motion: WorldMotion,
    time_s: Float[Array, " F"],
    sightings: Sequence[tuple[Shot, PersonTrack]],
) -> RecordedHands:
    """The hands of a person, at ease where nobody looked at them.

    `time_s` are the times of all frames of the video, `sightings` the shots in which he was seen and his track there.
    """
    looks = [_looks(person, motion, *sighting) for sighting in sightings if sighting[1].hands is not None]
    looks.append((np.zeros(0, np.int64), np.zeros((0, 2, _OF_WRIST.stop)), np.zeros((0, 2))))
    frame, values, confidence = (np.concatenate(parts) for parts in zip(*looks, strict=True))
    at_ease = np.concatenate([AT_EASE.ravel(), np.zeros(3)])
    found = [
        over_time(time_s[person.frame], time_s[frame], values[:, side], confidence[:, side], at_ease) for side in (0, 1)
    ]
    angles = np.stack([numbers[:, _OF_ANGLES].reshape(-1, *AT_EASE.shape) for numbers, _ in found], axis=1)
    body_pose = person.body_pose.copy()
    for wrist, (numbers, _) in zip(WRISTS, found, strict=True):
        bent = rotvec_to_rotmat(body_pose[:, wrist - 1]) @ rotvec_to_rotmat(numbers[:, _OF_WRIST])
        body_pose[:, wrist - 1] = rotmat_to_rotvec(bent)
    return RecordedHands(body_pose, hand_pose(angles), np.stack([certain for _, certain in found], axis=1))


def _looks(
    person: PersonMotion, motion: WorldMotion, shot: Shot, track: PersonTrack
) -> tuple[Array, Float[Array, "L 2 C"], Float[Array, "L 2"]]:
    """Frames, angles of the fingers and changes of the wrist, and confidence of one shot's looks."""
    assert track.hands is not None
    start, end = shot.outside_transitions
    inside = (track.frame >= start) & (track.frame < end) & np.isin(track.frame, person.frame)
    frame, hands = track.frame[inside].astype(np.int64), track.hands.chosen(inside)
    values, confidence = np.zeros((len(frame), 2, _OF_WRIST.stop)), hands.confidence.astype(np.float64)
    row = frame - int(person.frame[0]) if len(frame) else frame
    _, R_world_joint = forward_kinematics(
        load_body().rest_joints(person.betas), person.R_world_root[row], person.body_pose[row], person.pelvis_world[row]
    )
    for side, wrist in enumerate(WRISTS):
        seen = np.flatnonzero(confidence[:, side] > 0)
        points3d = hands.points3d[seen, side].astype(np.float64)
        middle = hands.points[seen, side].astype(np.float64).mean(axis=1)
        rays = unit(viewing_rays(middle[:, None], motion.K[frame[seen]])[:, 0])
        R_world_palm = motion.R_world_cam[frame[seen]] @ ray_axes(rays) @ palm_rotation(points3d, side)
        change = rotmat_to_rotvec(np.swapaxes(R_world_joint[seen, wrist], -1, -2) @ R_world_palm)
        believed = np.linalg.norm(change, axis=1) <= LARGEST_WRIST_CHANGE
        values[seen, side, _OF_ANGLES] = finger_angles(points3d, side).reshape(len(seen), AT_EASE.size)
        values[seen[believed], side, _OF_WRIST] = change[believed]
    return frame, values, confidence
