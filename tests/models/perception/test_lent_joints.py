"""Joints that lie on somebody else for a moment are unseen; others stay."""

from dataclasses import replace

import numpy as np
from walkers import walker

from humanmm.models.perception.lent_joints import without_lent_joints
from humanmm.models.records.tracks import PersonTrack, ScenePeople

ANKLE, HEEL, TOES = 28, 30, 32
TIME_S = np.arange(40) / 30
HIM, BESIDE = (walker(0, 40, (at, 100), speed_px=0.2, seed=seed) for at, seed in ((100, 1), (200, 2)))


def with_ankle(track: PersonTrack, frames: slice, at: np.ndarray, visibility: float) -> PersonTrack:
    keypoints = track.keypoints2d.copy()
    keypoints[frames, ANKLE, :2], keypoints[frames, ANKLE, 2] = at, visibility
    sigma = np.full(keypoints.shape[:2], 2.0, np.float32)
    return replace(track, keypoints2d=keypoints, keypoint_sigma=sigma)


def own(him: PersonTrack, beside: PersonTrack = BESIDE, time_s: np.ndarray = TIME_S) -> PersonTrack:
    return without_lent_joints(ScenePeople(0, 40, (him, beside)), time_s).tracks[0]


def test_an_ankle_that_leaps_onto_somebody_else_and_back_is_not_seen_meanwhile() -> None:
    span = slice(15, 22)
    lent = with_ankle(HIM, span, BESIDE.keypoints2d[span, ANKLE, :2] + 2, 0.5)
    found = own(lent)
    unseen = found.keypoints2d[..., 2] == 0
    assert unseen[span][:, [ANKLE, HEEL, TOES]].all() and unseen.sum() == 3 * 7
    assert found.keypoint_sigma is not None
    assert (found.keypoint_sigma[unseen] > 50).all() and (found.keypoint_sigma[~unseen] == 2).all()


def test_an_ankle_that_is_seen_well_where_the_others_is_stays() -> None:
    span = slice(15, 22)
    kick = with_ankle(HIM, span, BESIDE.keypoints2d[span, ANKLE, :2] + 2, 0.95)
    assert np.array_equal(own(kick).keypoints2d, kick.keypoints2d)


def test_an_ankle_that_leaps_where_nobody_is_stays() -> None:
    span = slice(15, 22)
    alone = with_ankle(HIM, span, HIM.keypoints2d[span, ANKLE, :2] - 70, 0.5)
    assert np.array_equal(own(alone).keypoints2d, alone.keypoints2d)


def test_limbs_of_people_who_pass_each_other_stay() -> None:
    him, passing = walker(0, 40, (100, 100), speed_px=3), walker(0, 40, (220, 100), speed_px=-3, seed=3)
    assert np.array_equal(own(him, passing).keypoints2d, him.keypoints2d)


def test_whoever_stands_on_somebodys_foot_for_longer_stays() -> None:
    span = slice(10, 32)
    lent = with_ankle(HIM, span, BESIDE.keypoints2d[span, ANKLE, :2] + 2, 0.5)
    assert np.array_equal(own(lent).keypoints2d, lent.keypoints2d)
