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
"""A palm that lies more than this from where the body has it is not believed: of the wrist such a look says nothing."""


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
    nothing = np.zeros(0, np.int64), np.zeros((0, 2, AT_EASE.size)), np.zeros((0, 2, 3)), *np.zeros((2, 0, 2))
    looks = [_looks(person, motion, *sighting) for sighting in sightings if sighting[1].hands is not None]
    frame, angles, bends, confidence, of_palm = (np.concatenate(parts) for parts in zip(nothing, *looks, strict=True))
    at, look_s = time_s[person.frame], time_s[frame]
    fingers = [over_time(at, look_s, angles[:, side], confidence[:, side], AT_EASE.ravel()) for side in (0, 1)]
    wrists = [over_time(at, look_s, bends[:, side], of_palm[:, side], np.zeros(3))[0] for side in (0, 1)]
    body_pose = person.body_pose.copy()
    for wrist, bend in zip(WRISTS, wrists, strict=True):
        bent = rotvec_to_rotmat(body_pose[:, wrist - 1]) @ rotvec_to_rotmat(bend)
        body_pose[:, wrist - 1] = rotmat_to_rotvec(bent)
    over_hands = np.stack([found.reshape(-1, *AT_EASE.shape) for found, _ in fingers], axis=1)
    return RecordedHands(body_pose, hand_pose(over_hands), np.stack([certain for _, certain in fingers], axis=1))


def _looks(
    person: PersonMotion, motion: WorldMotion, shot: Shot, track: PersonTrack
) -> tuple[Array, Float[Array, "L 2 C"], Float[Array, "L 2 3"], Float[Array, "L 2"], Float[Array, "L 2"]]:
    """Frames, angles of the fingers, changes of the wrist (radians), and confidence of one shot's looks in fingers and
    palms; nan where nobody looked, or a palm is not believed."""
    assert track.hands is not None
    start, end = shot.outside_transitions
    inside = (track.frame >= start) & (track.frame < end) & np.isin(track.frame, person.frame)
    frame, hands = track.frame[inside].astype(np.int64), track.hands.chosen(inside)
    angles, bends = np.zeros((len(frame), 2, AT_EASE.size)), np.zeros((len(frame), 2, 3))
    confidence = hands.confidence.astype(np.float64)
    of_palm = confidence.copy()
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
        bends[seen, side] = rotmat_to_rotvec(np.swapaxes(R_world_joint[seen, wrist], -1, -2) @ R_world_palm)
        of_palm[seen[np.linalg.norm(bends[seen, side], axis=1) > LARGEST_WRIST_CHANGE], side] = np.nan
        angles[seen, side] = finger_angles(points3d, side).reshape(len(seen), AT_EASE.size)
    return frame, angles, bends, confidence, of_palm
