"""Landmarks of hands whose fingers bend by known angles, and recordings with hands."""

import dataclasses

import numpy as np

from humanmm.models.body.fingers import NUM_BODY_JOINTS, WRISTS, load_body52
from humanmm.models.motion.hands.finger_joints import (
    AT_EASE,
    HIGHEST,
    LOWEST,
    SPREAD_OUT,
    finger_directions,
    fingertips,
    hand_pose,
)
from humanmm.models.motion.hands.lifting import CHAINS
from humanmm.models.records.recording import Recording


def random_angles(count: int, *, seed: int = 0) -> np.ndarray:
    """(count,5,5) angles of likely hands."""
    drawn = AT_EASE + 0.8 * SPREAD_OUT * np.random.default_rng(seed).normal(size=(count, 5, 5))
    return np.clip(drawn, LOWEST, HIGHEST)


def landmarks_of(side: int, angles: np.ndarray) -> np.ndarray:
    """(n,21,3) the hand network's landmarks of the left (0) or right (1) hand, metres, axes of the body at rest."""
    body = load_body52()
    first = NUM_BODY_JOINTS + 15 * side
    chain = np.concatenate([body.J_template[first : first + 15].reshape(5, 3, 3), fingertips(body, side)[:, None]], 1)
    bones = finger_directions(side, angles) * np.linalg.norm(np.diff(chain, axis=1), axis=-1, keepdims=True)
    points = np.zeros((len(angles), 21, 3))
    points[:, 0] = body.J_template[WRISTS[side]]
    for finger, landmarks in enumerate(CHAINS):
        points[:, landmarks[0]] = chain[finger, 0]
        for joint in range(3):
            points[:, landmarks[joint + 1]] = points[:, landmarks[joint]] + bones[:, finger, joint]
    return points


def with_hands(recording: Recording) -> Recording:
    """The same people, their fingers moving."""
    people = []
    for person in recording.people:
        phase = np.linspace(0, 6, len(person.frame))[:, None, None, None]
        angles = AT_EASE + 0.6 * SPREAD_OUT * np.sin(phase + np.arange(2)[:, None, None])
        confidence = np.tile(np.float32([0.9, 0.0]), (len(person.frame), 1))
        pose = hand_pose(np.clip(angles, LOWEST, HIGHEST)).astype(np.float32)
        people.append(dataclasses.replace(person, hand_pose=pose, hand_confidence=confidence))
    return dataclasses.replace(recording, people=tuple(people))
