"""Left and right along a track: one consistent choice for every frame, from continuity and second opinions.

The landmark network swaps left and right (and with them front and back) for whole runs of frames when the face is
hidden or the body leans far over, with full visibility. Between neighbouring frames a left-right swap shows as limbs
that jump across the body. Which of two stretches is right show the other networks (`keypoints.naming.side_odds`). A
chain of two states, kept and swapped, joins all of it.
"""

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.geometry.chains import two_state_chain
from humanmm.models.records import landmarks

LIMB_STEP = 0.03
"""How far a limb moves in STEP_S, as a fraction of the person's region: standard deviation."""
LIMB_STEP_M = 0.08
"""The same in the 3D landmarks, noise included."""
STEP_S = 1 / 30
PAIR_LIMIT, STEP_LIMIT = 3.0, 10.0
MAX_GAP_S = 0.4
KEEP_ODDS = 0.02
"""Log-odds a frame for the network's own labels: whole runs are wrong together, so one frame is weak evidence."""
VOTE_SPREAD = 0.02

_LEFT = np.array(landmarks.LIMBS[0::2])
_RIGHT = np.array(landmarks.LIMBS[1::2])


def side_vote(own: Float[np.ndarray, "33 3"], other: Float[np.ndarray, "33 3"], side: float) -> float:
    """Log-odds that a second look names left and right as the first did; near 0 where a body is seen from the side."""
    kept = np.linalg.norm(own[_LEFT, :2] - other[_LEFT, :2], axis=1)
    kept = kept + np.linalg.norm(own[_RIGHT, :2] - other[_RIGHT, :2], axis=1)
    crossed = np.linalg.norm(own[_LEFT, :2] - other[_RIGHT, :2], axis=1)
    crossed = crossed + np.linalg.norm(own[_RIGHT, :2] - other[_LEFT, :2], axis=1)
    return float(np.median(crossed - kept) / (VOTE_SPREAD * side))


def left_right_swaps(
    keypoints: Float[np.ndarray, "frames 33 3"],
    poses: Float[np.ndarray, "frames 33 3"],
    votes: Float[np.ndarray, " frames"],
    time_s: Float[np.ndarray, " frames"],
    side: Float[np.ndarray, " frames"],
) -> Bool[np.ndarray, " frames"]:
    """Frames in which the network has swapped left and right.

    `votes` are log-odds for the labels as they are (0 where there was no other look), `side` the regions' sides in
    pixels.
    """
    swapped = votes + KEEP_ODDS
    differ = _step_odds(keypoints, poses, time_s, side)
    return two_state_chain(
        np.stack([np.zeros_like(swapped), swapped], axis=1), np.stack([np.zeros_like(differ), differ], axis=1)
    )


def _step_odds(
    keypoints: Float[np.ndarray, "frames 33 3"],
    poses: Float[np.ndarray, "frames 33 3"],
    time_s: Float[np.ndarray, " frames"],
    side: Float[np.ndarray, " frames"],
) -> Float[np.ndarray, " steps"]:
    """Log-odds that two neighbouring frames name left and right alike."""
    gap = np.diff(time_s)
    slack = np.maximum(1.0, gap / STEP_S)
    odds = np.zeros(len(gap))
    for points, spread in ((keypoints[..., :2], LIMB_STEP * side[1:]), (poses, np.full(len(gap), LIMB_STEP_M))):
        left, right = points[:, _LEFT], points[:, _RIGHT]
        kept = ((left[1:] - left[:-1]) ** 2).sum(-1) + ((right[1:] - right[:-1]) ** 2).sum(-1)
        crossed = ((left[1:] - right[:-1]) ** 2).sum(-1) + ((right[1:] - left[:-1]) ** 2).sum(-1)
        per_pair = (crossed - kept) / (2 * (spread * slack)[:, None] ** 2)
        odds += np.clip(per_pair, -PAIR_LIMIT, PAIR_LIMIT).mean(axis=1) * 3
    return np.where(gap <= MAX_GAP_S, np.clip(odds, -STEP_LIMIT, STEP_LIMIT), 0.0)
