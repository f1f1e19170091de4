"""Left and right along a track: one consistent choice for every frame, from continuity and second opinions.

The landmark network exchanges left and right (and with them front and back) for whole runs of frames when the face is
hidden or the body leans far over, with full visibility. Between neighbouring frames an exchange shows as limbs that
jump across the body; which of two stretches is right is told by a second look at an upright crop, in which the ground
tells front from back (in a crop turned with a body that leans by 40°, a quarter of the frames came out exchanged; in
an upright one none). A Viterbi pass over keep / exchange joins both kinds of evidence.
"""

import numpy as np
from jaxtyping import Bool, Float, Int

from humanmm.models.records import landmarks

LIMB_SHARE = 0.03
"""How far a limb moves between neighbouring frames at 30 fps, as a share of the person's region: standard deviation."""
LIMB_METRES = 0.08
"""The same in the 3D landmarks, noise included."""
PAIR_LIMIT, STEP_LIMIT = 3.0, 10.0
MAX_GAP_S = 0.4
KEEP_ODDS = 0.02
"""Log-odds a frame for the network's own labels: runs are wrong together, so one frame says little."""
VOTE_SHARE, VOTE_LIMIT = 0.02, 2.0

_LEFT = np.array(landmarks.LIMBS[0::2])
_RIGHT = np.array(landmarks.LIMBS[1::2])


def side_vote(own: Float[np.ndarray, "33 3"], other: Float[np.ndarray, "33 3"], side: float) -> float:
    """Log-odds that a second look names left and right as the first did; near 0 where a body is seen from the side."""
    kept = np.linalg.norm(own[_LEFT, :2] - other[_LEFT, :2], axis=1)
    kept = kept + np.linalg.norm(own[_RIGHT, :2] - other[_RIGHT, :2], axis=1)
    crossed = np.linalg.norm(own[_LEFT, :2] - other[_RIGHT, :2], axis=1)
    crossed = crossed + np.linalg.norm(own[_RIGHT, :2] - other[_LEFT, :2], axis=1)
    return float(np.clip(np.median(crossed - kept) / (VOTE_SHARE * side), -VOTE_LIMIT, VOTE_LIMIT))


def exchanged_sides(
    keypoints: Float[np.ndarray, "frames 33 3"],
    poses: Float[np.ndarray, "frames 33 3"],
    votes: Float[np.ndarray, " frames"],
    time_s: Float[np.ndarray, " frames"],
    side: Float[np.ndarray, " frames"],
) -> Bool[np.ndarray, " frames"]:
    """Frames whose left and right labels are to be exchanged.

    `votes` are log-odds for the labels as they are (0 where there was no second look), `side` the regions' sides in
    pixels.
    """
    steps = _step_odds(keypoints, poses, time_s, side)
    cost = np.zeros((len(votes), 2))
    cost[:, 1] = votes + KEEP_ODDS
    best, came_from = cost[0], np.zeros((len(votes), 2), np.int64)
    for n in range(1, len(votes)):
        change = np.array([[0.0, steps[n - 1]], [steps[n - 1], 0.0]])
        total = best[:, None] + change
        came_from[n] = total.argmin(axis=0)
        best = total.min(axis=0) + cost[n]
    states: Int[np.ndarray, " frames"] = np.zeros(len(votes), np.int64)
    states[-1] = best.argmin()
    for n in range(len(votes) - 1, 0, -1):
        states[n - 1] = came_from[n, states[n]]
    return np.asarray(states == 1)


def _step_odds(
    keypoints: Float[np.ndarray, "frames 33 3"],
    poses: Float[np.ndarray, "frames 33 3"],
    time_s: Float[np.ndarray, " frames"],
    side: Float[np.ndarray, " frames"],
) -> Float[np.ndarray, " steps"]:
    """Log-odds that two neighbouring frames name left and right alike."""
    gap = np.diff(time_s)
    slack = np.maximum(1.0, gap * 30)
    odds = np.zeros(len(gap))
    for points, spread in ((keypoints[..., :2], LIMB_SHARE * side[1:]), (poses, np.full(len(gap), LIMB_METRES))):
        left, right = points[:, _LEFT], points[:, _RIGHT]
        kept = ((left[1:] - left[:-1]) ** 2).sum(-1) + ((right[1:] - right[:-1]) ** 2).sum(-1)
        crossed = ((left[1:] - right[:-1]) ** 2).sum(-1) + ((right[1:] - left[:-1]) ** 2).sum(-1)
        per_pair = (crossed - kept) / (2 * (spread * slack)[:, None] ** 2)
        odds += np.clip(per_pair, -PAIR_LIMIT, PAIR_LIMIT).mean(axis=1) * 3
    return np.where(gap <= MAX_GAP_S, np.clip(odds, -STEP_LIMIT, STEP_LIMIT), 0.0)
