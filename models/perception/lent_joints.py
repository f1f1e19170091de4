"""Joints that one person lends another: where two are close a pose network may see somebody else's limb for a moment.

A keypoint that leaps onto the same joint of another person, who is seen well, and back to where its own path went on
meanwhile, is the other's. It counts as not seen then, and the fit carries the limb through.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, Int

from humanmm.models.geometry.boxes import box_size
from humanmm.models.geometry.intervals import runs_of_true
from humanmm.models.records.landmarks import BEYOND, SWAP
from humanmm.models.records.tracks import PersonTrack, ScenePeople

Array = np.ndarray

JOINTS = (13, 14, 15, 16, 25, 26, 27, 28)
"""Elbows, wrists, knees, ankles."""
NEAR, AWAY, LEAP = 0.08, 0.12, 0.12
"""So near to the other's joint, so far from the own path in the median, and so far from one look to the next, as
fractions of the body's size in the picture (the root of its box's area, about 1.3 m of somebody who stands)."""
SURE = 0.75
"""Visibility that the other's joint has, and the own one, which would be seen as well there, has not in the median."""
LONGEST_S = 0.6
"""Between the last look before and the first one after."""


def without_lent_joints(people: ScenePeople, time_s: Float[Array, " L"]) -> ScenePeople:
    """Everybody's tracks, the keypoints that lie on somebody else unseen; `time_s` of the frames that tracks count."""
    tracks = tuple(
        _unseen(one, np.any([_lent(one, other, time_s) for other in people.tracks if other is not one], axis=0))
        if len(people.tracks) > 1
        else one
        for one in people.tracks
    )
    return replace(people, tracks=tracks)


def _lent(one: PersonTrack, other: PersonTrack, time_s: Float[Array, " L"]) -> Bool[Array, "N 33"]:
    """Where joints of one person are another's."""
    lent = np.zeros(one.keypoints2d.shape[:2], bool)
    _, rows, of_other = np.intersect1d(one.frame, other.frame, assume_unique=True, return_indices=True)
    if not len(rows):
        return lent
    size = box_size(one.bbox.astype(np.float64))
    for joint in JOINTS:
        path = one.keypoints2d[:, joint, :2].astype(np.float64)
        near = np.zeros(len(one.frame), bool)
        for same in (joint, SWAP[joint]):
            theirs = other.keypoints2d[of_other, same]
            apart = np.linalg.norm(path[rows] - theirs[:, :2], axis=-1)
            near[rows] |= (apart < NEAR * size[rows]) & (theirs[:, 2] >= SURE)
        for start, end in _excursions(near, path, size, one.frame, time_s):
            if np.median(one.keypoints2d[start:end, joint, 2]) < SURE:
                lent[start:end, [joint, *BEYOND.get(joint, ())]] = True
    return lent


def _excursions(
    near: Bool[Array, " N"],
    path: Float[Array, "N 2"],
    size: Float[Array, " N"],
    frame: Int[Array, " N"],
    time_s: Float[Array, " L"],
) -> Iterator[tuple[int, int]]:
    """Runs of rows near the other's joint to which a joint leaps, away from the straight line between the rows beside
    them, and from which it leaps back."""
    for start, end in runs_of_true(near):
        before, after = start - 1, end
        if before < 0 or after >= len(near) or frame[after] - frame[before] != after - before:
            continue
        spanned_s = time_s[frame[after]] - time_s[frame[before]]
        if spanned_s > LONGEST_S:
            continue
        share = ((time_s[frame[start:end]] - time_s[frame[before]]) / spanned_s)[:, None]
        own = (1 - share) * path[before] + share * path[after]
        away = np.linalg.norm(path[start:end] - own, axis=-1) / size[start:end]
        leaps = [np.linalg.norm(path[a] - path[b]) / size[a] for a, b in ((start, before), (end - 1, after))]
        if np.median(away) >= AWAY and min(leaps) >= LEAP:
            yield start, end


def _unseen(track: PersonTrack, where: Bool[Array, "N 33"]) -> PersonTrack:
    """The track with some keypoints unseen: visibility 0, and as uncertain as the body is large."""
    if not where.any():
        return track
    keypoints, sigma = track.keypoints2d.copy(), track.keypoint_sigma
    keypoints[where, 2] = 0.0
    if sigma is not None:
        size = box_size(track.bbox.astype(np.float64))
        sigma = np.where(where, np.maximum(sigma, size[:, None]), sigma).astype(np.float32)
    return replace(track, keypoints2d=keypoints, keypoint_sigma=sigma)
