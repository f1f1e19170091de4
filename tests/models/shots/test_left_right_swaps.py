"""Left and right of one person over the shots of a video."""

from dataclasses import replace

import numpy as np
import pytest
from walking import K, case, sighting

from humanmm.models.records.landmarks import INDEX, SWAP
from humanmm.models.shots.left_right_swaps import KnownSides, SidesSeen, left_right_swaps


def swapped(s: SidesSeen, frames: slice) -> SidesSeen:
    keypoints, landmarks = s.keypoints2d.copy(), s.landmarks3d.copy()
    keypoints[frames], landmarks[frames] = (x[frames][:, SWAP] for x in (keypoints, landmarks))
    return replace(s, keypoints2d=keypoints, landmarks3d=landmarks)


def test_a_run_of_swapped_frames_within_a_shot_is_found() -> None:
    person, _ = case(50.0)
    s = sighting(person.before)
    assert left_right_swaps([swapped(s, slice(4, 9))], K) == (((int(s.frame[4]), int(s.frame[9])),),)


def test_a_rightly_labelled_video_is_left_alone() -> None:
    person, _ = case(130.0)
    assert left_right_swaps([sighting(person.before), sighting(person.after)], K) == ((), ())


def test_other_networks_decide_what_the_motion_leaves_open() -> None:
    person, _ = case(50.0)
    s = sighting(person.before)
    doubted = replace(s, side_odds=np.full(len(s.frame), -4.0))
    assert left_right_swaps([doubted], K) == (((int(s.frame[0]), int(s.frame[-1]) + 1),),)
    assert left_right_swaps([replace(s, side_odds=np.full(len(s.frame), 1.5))], K) == ((),)


def test_a_lifter_that_is_sure_in_every_frame_does_not_outvote_two_networks_that_see_him() -> None:
    person, _ = case(50.0)
    s = sighting(person.before)
    s = replace(s, swap_odds=np.full(len(s.frame), 8.0))
    assert left_right_swaps([s], K) != ((),)
    assert left_right_swaps([replace(s, side_odds=np.full(len(s.frame), 1.6))], K) == ((),)


@pytest.mark.parametrize("angle_deg", [10.0, 90.0, 170.0])
def test_a_whole_shot_with_left_and_right_swapped_is_found_by_the_cut(angle_deg: float) -> None:
    person, _ = case(angle_deg)
    first, second = sighting(person.before), sighting(person.after)
    spans = left_right_swaps([first, swapped(second, slice(None))], K)
    assert spans == ((), ((int(second.frame[0]), int(second.frame[-1]) + 1),))


def _reported(s: SidesSeen, row: int, *, wrong: bool) -> KnownSides:
    """What a user says who sees in one row where left and right are, of a track whose labels are right or wrong."""
    pair = INDEX["left_hip"], INDEX["right_hip"]
    places = s.keypoints2d[row, list(pair), :2].astype(float)
    first = int(s.frame[0])
    return KnownSides(first, first + 3, int(s.frame[row]), pair, places[::-1] if wrong else places)


def test_what_the_user_says_of_a_few_frames_holds_and_the_rest_of_the_shot_follows() -> None:
    person, _ = case(50.0)
    s = sighting(person.before)
    assert left_right_swaps([s], K, [_reported(s, 1, wrong=True)]) == (((int(s.frame[0]), int(s.frame[-1]) + 1),),)


def test_sides_that_are_found_as_the_user_says_stay_as_they_are() -> None:
    person, _ = case(50.0)
    s = swapped(sighting(person.before), slice(4, 9))
    assert left_right_swaps([s], K, [_reported(s, 1, wrong=False)]) == left_right_swaps([s], K)


def test_a_place_in_a_frame_that_is_not_seen_is_taken_to_be_that_of_the_nearest() -> None:
    person, _ = case(50.0)
    whole = sighting(person.before)
    seen = whole.only(np.arange(len(whole.frame)) != 1)
    every = (((int(whole.frame[0]), int(whole.frame[-1]) + 1),),)
    assert left_right_swaps([seen], K, [_reported(whole, 1, wrong=True)]) == every
    assert left_right_swaps([seen], K, [_reported(whole, 1, wrong=False)]) == ((),)


def test_a_place_near_which_nothing_is_seen_changes_nothing() -> None:
    person, _ = case(50.0)
    s = sighting(person.before)
    for wrong in (True, False):
        said = replace(_reported(s, 1, wrong=wrong), frame=int(s.frame[-1]) + 9)
        assert not said.is_answered([s]) and left_right_swaps([s], K, [said]) == ((),)


def test_without_a_place_what_is_found_is_swapped_in_all_those_frames() -> None:
    person, _ = case(130.0)
    first, second = sighting(person.before), sighting(person.after)
    whole = (int(first.frame[0]), int(second.frame[-1]) + 1)
    spans = left_right_swaps([first, second], K, [KnownSides(*whole, frame=whole[0])])
    assert spans == tuple(((int(s.frame[0]), int(s.frame[-1]) + 1),) for s in (first, second))


def test_only_frames_in_the_span_are_held_and_none_of_them_gives_way() -> None:
    person, _ = case(50.0)
    s = sighting(person.before)
    first, last = int(s.frame[4]), int(s.frame[7])
    known = [KnownSides(first, last, first), KnownSides(last, int(s.frame[-1]) + 1, last)]
    ((span,),) = left_right_swaps([s], K, known)
    state = np.isin(s.frame, np.arange(*span))
    assert state[4:].all()
