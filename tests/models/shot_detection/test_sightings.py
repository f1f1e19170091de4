"""What two sightings of a person have in common, and how fast he usually moves."""

import numpy as np
import pytest
from walkers import walker

from humanmm.models.records.landmarks import SWAP
from humanmm.models.records.tracks import PersonTrack
from humanmm.models.shot_detection.sightings import Sightings, step

TIME_S = np.arange(60) / 30


def seen(track: PersonTrack) -> Sightings:
    return Sightings(track, np.arange(len(TIME_S)), TIME_S)


def test_neighbouring_sightings_of_somebody_who_walks_are_nearly_the_same() -> None:
    person = seen(walker(0, 60, (100, 200)))
    change = step(person, 20, person, 21)
    assert change is not None and change.box_iou > 0.8 and change.keypoint_iou > 0.5 and change.distance < 0.06


def test_labels_that_swap_are_the_same_sighting_and_a_body_upside_down_is_none() -> None:
    swapped, upturned = walker(0, 60, (100, 200)), walker(0, 60, (100, 200))
    swapped.keypoints2d[30:] = swapped.keypoints2d[30:, SWAP]
    upturned.keypoints2d[30:, :, 1] = 400 - upturned.keypoints2d[30:, :, 1]
    of_swapped, of_upturned = seen(swapped), seen(upturned)
    change = step(of_swapped, 29, of_swapped, 30)
    assert change is not None and change.distance < 0.06
    assert step(of_upturned, 29, of_upturned, 30) is None


def test_doubtful_sightings_are_left_out() -> None:
    track = walker(0, 60, (100, 200))
    track.confidence[10:20] = 0.2
    assert not set(range(10, 20)) & set(seen(track).looks.tolist())


def test_the_usual_speed_is_in_sizes_of_the_body_a_second() -> None:
    def usual(speed_px: float) -> float:
        person = seen(walker(0, 60, (100, 200), speed_px=speed_px))
        speed = person.usual_speed(30, 0.4)
        assert speed is not None
        return speed * float(person.size[30])

    assert usual(24.0) == pytest.approx(24 * 30, rel=0.35)
    assert usual(48.0) == pytest.approx(48 * 30, rel=0.35)


def test_sightings_are_counted_in_looks_and_what_lies_between_two_is_none() -> None:
    looks = np.array([0, 1, *range(2, 58, 2), 58, 59])
    person = Sightings(walker(0, 60, (100, 200)), looks, TIME_S[looks])
    assert person.looks.tolist() == list(range(len(looks)))
    assert [person.row[look] for look in range(len(looks))] == looks.tolist()
    assert person.step_s == pytest.approx(2 / 30)
