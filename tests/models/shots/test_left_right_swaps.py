"""Left and right of one person over the shots of a video."""

from dataclasses import replace

import pytest
from walking import K, case, sighting

from humanmm.models.records.landmarks import SWAP
from humanmm.models.shots.left_right_swaps import Sighting, left_right_swaps


def swapped(s: Sighting, frames: slice) -> Sighting:
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


@pytest.mark.parametrize("angle_deg", [10.0, 90.0, 170.0])
def test_a_whole_shot_with_left_and_right_swapped_is_found_by_the_cut(angle_deg: float) -> None:
    person, _ = case(angle_deg)
    first, second = sighting(person.before), sighting(person.after)
    spans = left_right_swaps([first, swapped(second, slice(None))], K)
    assert spans == ((), ((int(second.frame[0]), int(second.frame[-1]) + 1),))
