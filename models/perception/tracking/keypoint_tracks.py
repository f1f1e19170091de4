"""Everybody in one scene from the keypoints that another program found in every picture, who is who unknown."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.optimize import linear_sum_assignment

from humanmm.models.geometry.intrinsics import K_from_focal, default_focal_px
from humanmm.models.perception.interfaces import SEEN, KeypointLifter
from humanmm.models.perception.lifting.coco import FEWEST, boxes_about, coco_track
from humanmm.models.perception.tracking.overlooked import crowded_out, followed
from humanmm.models.perception.tracking.track_builder import largest_first, shortest_track_s
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.models.video.frame_times import elapsed_s, shown_s

Array = np.ndarray

REACH, REACH_PER_S = 0.25, 1.0
"""How far a person's keypoints get between two pictures, mean of all, in sides of his box: at once, and by moving."""
LOST_S = 1.0
"""Whoever is not seen for longer comes back as somebody else; the search for the same people across cuts may join
them."""
FAR = 1e6


@dataclass(frozen=True, eq=False)
class PictureKeypoints:
    """People in pictures, one a row: COCO's 17 keypoints, source pixels and score 0..1 (0: not found)."""

    frame: Int[Array, " M"]
    """Not decreasing."""
    keypoints: Float[Array, "M 17 3"]
    warnings: tuple[str, ...] = ()
    """What is odd about them, one sentence each."""


def people_of_keypoints(
    found: PictureKeypoints, facts: VideoFacts, span: tuple[int, int], *, max_people: int, lifter: KeypointLifter
) -> ScenePeople:
    """The tracks of one scene's frames [start, end), largest first: people who lie near each other in successive
    pictures are one; of more than `max_people` at a time those with the best scores.

    Colours are unknown, masks are drawn about the bones, 3D landmarks are the lifter's.
    """
    rows = slice(*np.searchsorted(found.frame, span))
    time_s, size = facts.time_s, (facts.width, facts.height)
    K = K_from_focal(default_focal_px(*size), *size)
    shortest_s = shortest_track_s(time_s, span)
    frame, keypoints = found.frame[rows], found.keypoints[rows]
    people = [own for own in link(frame, keypoints, time_s) if float(shown_s(time_s, frame[own]).sum()) >= shortest_s]
    score = [float(keypoints[own, :, 2].sum()) for own in people]
    kept = followed([frame[own] for own in people], score, max_people)
    tracks = largest_first(
        coco_track(frame[own], keypoints[own], time_s=time_s[frame[own]], K=K, size=size, lifter=lifter)
        for own in (people[k] for k in kept)
    )
    others = tuple(
        crowded_out(
            frame[own],
            boxes_about(keypoints[own, :, :2], keypoints[own, :, 2] >= SEEN, size),
            score[k] / keypoints[own, :, 2].size,
        )
        for k, own in enumerate(people)
        if k not in kept
    )
    return ScenePeople(*span, tracks, found.warnings, others)


def link(
    frame: Int[Array, " M"], keypoints: Float[Array, "M 17 3"], time_s: Float[Array, " F"]
) -> list[Int[Array, " n"]]:
    """Of every person the rows that are his, at most one a frame; rows of hardly a keypoint are nobody's."""
    usable = (keypoints[..., 2] >= SEEN).sum(axis=1) >= FEWEST
    people: list[list[int]] = []
    for f in np.unique(frame):
        rows = np.flatnonzero((frame == f) & usable)
        near = [person for person in people if elapsed_s(time_s, int(frame[person[-1]]), int(f)) <= LOST_S]
        cost = np.full((len(near), len(rows)), FAR)
        for i, person in enumerate(near):
            gap_s = elapsed_s(time_s, int(frame[person[-1]]), int(f))
            for j, row in enumerate(rows):
                distance = _distance(keypoints[person[-1]], keypoints[row]) / (REACH + REACH_PER_S * gap_s)
                cost[i, j] = distance if distance < 1 else FAR
        taken = set()
        for person_index, column in zip(*linear_sum_assignment(cost), strict=True):
            if cost[person_index, column] < FAR:
                near[person_index].append(int(rows[column]))
                taken.add(int(rows[column]))
        people += [[int(row)] for row in rows if int(row) not in taken]
    return [np.array(person) for person in people]


def _distance(a: Float[Array, "17 3"], b: Float[Array, "17 3"]) -> float:
    """Mean distance of the keypoints that both have, in sides of the larger box; ∞ if they share hardly one."""
    both = (a[:, 2] >= SEEN) & (b[:, 2] >= SEEN)
    if both.sum() < FEWEST // 2:
        return np.inf
    side = max(float(np.ptp(one[one[:, 2] >= SEEN, :2], axis=0).max()) for one in (a, b))
    return float(np.linalg.norm(a[both, :2] - b[both, :2], axis=1).mean()) / max(side, 1.0)
