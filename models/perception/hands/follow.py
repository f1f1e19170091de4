"""Following both hands of a person: a hand is looked for where it was, moved with the wrist, else where the body says.

What is found must be a hand of that side and lie at the body's wrist: else it is the other hand, somebody else's or a
ball.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.perception.hands.crops import of_body, of_points
from humanmm.models.perception.hands.network import Hand, look
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import Region
from humanmm.models.records.hands import NUM_POINTS, HandTracks, not_looked
from humanmm.models.records.landmarks import WRISTS
from humanmm.models.video.frame_times import ROUNDING_S, sampled_every, shown_s

Array = np.ndarray
NUMBERS = 1 + 5 * NUM_POINTS
"""Of one look at a hand: its confidence, points and points in space, one after the other."""

LOOK_S = 1 / 15
"""A hand is looked at so often, left and right in turn; where frames are further apart, both in each."""
MIN_CONFIDENCE = 0.4
"""Presence times probability of the side. Looked at in 12 frames of two clips: hands that the points fit have 0.6 to 1,
balls, sleeves, the other hand, and palms that are taken for backs less than 0.3."""
MAX_WRIST_OFFSET = 0.25
"""Distance between the hand's wrist and the body's, as a fraction of the side of the region that the body gives."""
MIN_VISIBILITY = 0.1
"""Of the body's wrist, as in MediaPipe Holistic: hands of wrists that are seen less are not looked for."""
MIN_SIDE_PX = 24.0
"""Side of a region in which no finger can be told from another."""

Looks = Float[np.ndarray, "2 numbers"]


def due_frames(time_s: Float[Array, " F"]) -> Bool[Array, "F 2"]:
    """In which of a scene's frames the left and the right hand are looked at."""
    half = np.flatnonzero(sampled_every(time_s, LOOK_S / 2))
    apart_s = shown_s(time_s[half], np.arange(len(half))) if len(half) > 1 else np.array([np.inf])
    due = np.zeros((len(time_s), 2), bool)
    due[half[0::2], 0] = due[half[1::2], 1] = True
    due[half[apart_s > LOOK_S + ROUNDING_S]] = True
    return due


def look_at_hands(
    image: Picture,
    keypoints: Float[Array, "33 3"],
    due: Bool[Array, " 2"],
    before: Sequence[tuple[Float[Array, "33 3"], Looks]],
) -> Looks:
    """What is seen of the hands that are due; `before`: body and looks of the frames about this one, nearest first.

    The confidence in a hand that is not due is nan, of one that is not to be seen 0.
    """
    looks = np.zeros((2, NUMBERS), np.float32)
    looks[~due, 0] = np.nan
    for side in np.flatnonzero(due):
        hand = _find(image, keypoints, int(side), _where_it_was(keypoints, int(side), before))
        if hand is not None:
            looks[side] = np.concatenate([[hand.confidence(int(side))], hand.points.ravel(), hand.points3d.ravel()])
    return looks


def _where_it_was(
    keypoints: Float[Array, "33 3"], side: int, before: Sequence[tuple[Float[Array, "33 3"], Looks]]
) -> Region | None:
    """The region of the last look, moved with the body's wrist; None if the hand was not seen then."""
    for body, looks in before:
        if np.isnan(looks[side, 0]):
            continue
        if looks[side, 0] == 0:
            return None
        dx, dy = keypoints[WRISTS[side], :2] - body[WRISTS[side], :2]
        return of_points(looks[side, 1 : 1 + 2 * NUM_POINTS].reshape(NUM_POINTS, 2).astype(np.float64)).moved(dx, dy)
    return None


def _find(image: Picture, keypoints: Float[Array, "33 3"], side: int, known: Region | None) -> Hand | None:
    by_body = of_body(keypoints, side)
    wrist = keypoints[WRISTS[side]]
    if by_body is None or wrist[2] < MIN_VISIBILITY or by_body.side < MIN_SIDE_PX:
        return None
    hand = look(image, known or by_body)
    apart = float(np.linalg.norm(hand.points[0] - wrist[:2]))
    return hand if hand.confidence(side) >= MIN_CONFIDENCE and apart <= MAX_WRIST_OFFSET * by_body.side else None


def hand_tracks(looks: list[Looks | None]) -> HandTracks:
    """The looks of the frames of a track; None where there was none."""
    tracks = not_looked(len(looks))
    for row, found in enumerate(looks):
        if found is not None:
            tracks.confidence[row] = found[:, 0]
            tracks.points[row] = found[:, 1 : 1 + 2 * NUM_POINTS].reshape(2, NUM_POINTS, 2)
            tracks.points3d[row] = found[:, 1 + 2 * NUM_POINTS :].reshape(2, NUM_POINTS, 3)
    return tracks
