"""Time left out shows where the picture changes a little and everybody leaps a little, and in neither alone."""

import dataclasses

import numpy as np
import pytest
from walkers import joined, looked_at_seldom, walker

from humanmm.models.perception.between_looks import looked_at
from humanmm.models.records.landmarks import SWAP
from humanmm.models.records.shots import Change, Scenes
from humanmm.models.records.tracks import PersonTrack, ScenePeople
from humanmm.models.shot_detection.leaps import CERTAIN, SUSPECTED, Leap, leaps

TIME_S = np.arange(60) / 30


def found(*tracks: PersonTrack, outstanding: float = 1.2, step: tuple[float, float] = (0.0, 0.0)) -> list[Leap]:
    """What is found beside a change at frame 30."""
    scenes = Scenes(60, (), changes=(Change(30, outstanding, step),))
    return list(leaps(scenes, [None, ScenePeople(0, 60, tracks)], time_s=TIME_S))


def leaper(leap_px: float, *, start: int = 0, end: int = 60, seed: int = 0) -> PersonTrack:
    """Somebody who walks, and is some pixels ahead from frame 30 on."""
    track = walker(start, end, (100, 200), seed=seed)
    ahead = np.where(track.frame >= 30, leap_px, 0.0)
    track.keypoints2d[..., 0] += ahead[:, None]
    track.bbox[:, [0, 2]] += ahead[:, None]
    return track


def test_a_leap_and_a_change_together_are_a_cut() -> None:
    (leap,) = found(leaper(40))
    assert leap.frame == 30 and leap.certain


def test_the_less_of_either_the_weaker_until_it_is_suspected_and_then_nothing() -> None:
    (strong,), (weak,) = found(leaper(40), outstanding=2.0), found(leaper(40), outstanding=1.0)
    assert strong.strength == pytest.approx(2 * weak.strength)
    factor = SUSPECTED / weak.strength
    (suspected,) = found(leaper(40), outstanding=1.1 * factor)
    assert SUSPECTED < suspected.strength < CERTAIN and not suspected.certain
    assert found(leaper(40), outstanding=0.9 * factor) == []
    assert found(leaper(0), outstanding=1.5) == [] and found(leaper(4), outstanding=9.0) == []


def test_whoever_runs_does_not_leap() -> None:
    assert found(walker(0, 60, (100, 200), speed_px=20)) == []


def test_whoever_goes_on_proves_that_time_does_and_whoever_stands_still_proves_nothing() -> None:
    assert found(leaper(40), walker(0, 60, (500, 200), seed=1)) == []
    standing = walker(0, 60, (500, 200), seed=1)
    standing.keypoints2d[:] = standing.keypoints2d[0]
    assert len(found(leaper(40), standing)) == 1


def test_who_may_be_nobody_proves_and_shows_nothing() -> None:
    nobody = dataclasses.replace(walker(0, 60, (500, 200), seed=1), probability=0.4)
    assert len(found(leaper(40), nobody)) == 1
    assert found(dataclasses.replace(leaper(40), probability=0.4)) == []


def test_a_knock_carries_the_place_along() -> None:
    assert found(leaper(40), step=(38.0, 2.0)) == []
    assert len(found(leaper(40), step=(-38.0, 2.0))) == 1  # a camera that turns the other way


def test_left_and_right_that_are_mistaken_from_a_frame_on_are_no_leap() -> None:
    track = walker(0, 60, (100, 200))
    track.keypoints2d[30:] = track.keypoints2d[30:, SWAP]
    assert found(track) == []


def test_an_error_of_a_few_frames_is_no_leap() -> None:
    track = walker(0, 60, (100, 200))
    track.keypoints2d[30:33, :, :2] += 60
    assert found(track) == []


def test_people_are_compared_by_their_own_sightings() -> None:
    """Of a video of 60 Hz every second frame is looked at."""
    track = leaper(40)
    track.confidence[1::2] = 0.0
    assert len(found(track)) == 1


@pytest.mark.parametrize(("rate_hz", "looks_hz"), [(50, 30), (60, 30), (120, 30), (30, 15)])
def test_a_leap_between_two_looks_is_found_where_the_picture_changes(rate_hz: int, looks_hz: int) -> None:
    time_s = np.arange(60 * rate_hz // looks_hz) / rate_hz
    looks = looked_at(time_s, (0, len(time_s)), max_rate_hz=looks_hz, every=5)

    def where(leap_px: float, change: int) -> list[int]:
        track = walker(0, len(looks), (100, 200))
        ahead = np.where(looks >= looks[30], leap_px, 0.0)
        track.keypoints2d[..., 0] += ahead[:, None]
        track.bbox[:, [0, 2]] += ahead[:, None]
        scenes = Scenes(len(time_s), (), changes=(Change(change, 1.2, (0.0, 0.0)),))
        people = looked_at_seldom(track, looks=looks, time_s=time_s)
        return [leap.frame for leap in leaps(scenes, [people], time_s=time_s) if leap.certain]

    for change in range(int(looks[29]) + 1, int(looks[30]) + 1):
        assert where(40, change) == where(120, change) == [change]
        assert where(0, change) == []


def test_who_is_lost_for_long_tells_nothing() -> None:
    assert found(joined(walker(0, 26, (100, 200)), walker(32, 60, (204, 200)))) == []
    assert found(leaper(40, start=29)) == [] and found(leaper(40, end=31)) == []
