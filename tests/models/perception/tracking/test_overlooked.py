"""Whom the detector sees again and again without anybody following him."""

import numpy as np
import pytest

from humanmm.models.perception.interfaces import Detection
from humanmm.models.perception.observation import Observation
from humanmm.models.perception.regions import Region
from humanmm.models.perception.tracking.overlooked import Overlooked, followed

TIME_S = np.arange(200) / 30
BOX = np.array([0.0, 20.0, 200.0, 240.0])


def detection(box: np.ndarray = BOX, score: float = 0.4) -> Detection:
    return Detection(score, Region(100, 240, 500), box)


def observation(box: np.ndarray) -> Observation:
    region = Region(500, 100, 100)
    mask = np.zeros((128, 128), np.uint8)
    return Observation(np.zeros((33, 3)), np.zeros((33, 3)), box, 0.9, mask, region, region)


def overlooked(searches: dict[int, list[Detection]], followed: list[Observation]) -> Overlooked:
    result = Overlooked(TIME_S, max_people=2)
    for frame, detected in searches.items():
        result.note(frame, detected, followed)
    return result


def test_who_is_seen_in_search_after_search_is_overlooked_and_who_flickers_is_not() -> None:
    stays = {frame: [detection(BOX + frame / 10)] for frame in range(0, 60, 10)}
    (one,) = overlooked(stays, [observation(BOX + 300)]).finished()
    assert (one.first, one.last) == (0, 50) and one.score == pytest.approx(0.4) and not one.crowded
    assert overlooked({0: [detection()], 10: [detection()]}, []).finished() == ()  # for a moment
    assert overlooked({0: [detection()], 40: [detection()], 80: [detection()]}, []).finished() == ()  # now and then
    weak = {frame: [detection(score=0.1)] for frame in range(0, 60, 10)}
    assert overlooked(weak, []).finished() == ()


def test_who_is_followed_is_not_overlooked_and_in_a_crowd_it_is_said() -> None:
    stays = {frame: [detection()] for frame in range(0, 60, 10)}
    assert overlooked(stays, [observation(BOX + 20)]).finished() == ()
    others = [observation(BOX + 300), observation(BOX + 600)]
    (one,) = overlooked(stays, others).finished()
    assert one.crowded


def test_so_many_are_followed_at_a_time_and_not_in_all() -> None:
    early, late, long = np.arange(5), np.arange(5, 9), np.arange(9)
    assert followed([early, late, long], [3.0, 2.0, 1.0], 1) == [0, 1], "one after the other"
    assert followed([early, late, long], [3.0, 2.0, 9.0], 1) == [2]
    assert followed([early, late, long], [3.0, 2.0, 9.0], 2) == [2, 0, 1]
