"""Tracks put right at the end of a scene."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from humanmm.models.perception.clothing import HISTOGRAM_BINS
from humanmm.models.perception.observation import Observation
from humanmm.models.perception.regions import Region
from humanmm.models.perception.tracking import linking
from humanmm.models.perception.tracking.linking import untangled
from humanmm.models.perception.tracking.track_builder import TrackBuilder
from humanmm.models.records.landmarks import HIPS

TIME_S = np.arange(500) / 30
UNSEEN = np.full((9, 3), np.nan)
SIZE = (1280, 720)
RED, BLUE = np.eye(HISTOGRAM_BINS)[3], np.eye(HISTOGRAM_BINS)[17]


def seen_at(x: float) -> Observation:
    region = Region(x, 200.0, 200.0)
    keypoints = np.tile([x, 200.0, 1.0], (33, 1))
    box = np.array([x - 40, 120, x + 40, 280])
    return Observation(keypoints, np.zeros((33, 3)), box, 0.9, np.zeros((128, 128), np.uint8), region, region)


def track(frames: range, x: float, colours: np.ndarray, time_s: np.ndarray = TIME_S) -> TrackBuilder:
    result = TrackBuilder(time_s, seen_at(x), frames[0])
    for frame in frames:
        result.add(frame, seen_at(x))
        if frame % 5 == 0:
            result.colours[frame] = colours
            result.parts[frame] = UNSEEN
    return result


def upright_at(x: float) -> Observation:
    seen = seen_at(x)
    keypoints = seen.keypoints.copy()
    keypoints[list(HIPS), 1] += 60  # the trunk is 60 pixels long
    return replace(seen, keypoints=keypoints)


def in_parts(track: TrackBuilder, parts: np.ndarray) -> TrackBuilder:
    track.parts = dict.fromkeys(track.parts, parts)
    return track


def joined(tracks: list[TrackBuilder]) -> list[TrackBuilder]:
    return linking.joined(tracks, SIZE)


def spans(tracks: list[TrackBuilder]) -> list[tuple[int, int]]:
    return sorted((min(t.rows), max(t.rows)) for t in tracks)


def test_a_person_lost_for_a_moment_goes_on_as_one_track() -> None:
    assert spans(joined([track(range(0, 30), 300, RED), track(range(40, 70), 330, RED)])) == [(0, 69)]


def test_people_in_other_clothes_or_at_the_same_time_are_not_joined() -> None:
    assert len(joined([track(range(0, 30), 300, RED), track(range(60, 90), 900, BLUE)])) == 2
    assert len(joined([track(range(0, 30), 300, RED), track(range(20, 60), 300, RED)])) == 2


def test_a_track_that_lingers_where_its_person_was_ends_where_he_is_found_again() -> None:
    lingering, found_again = track(range(0, 40), 300, RED), track(range(32, 70), 420, RED)
    lingering.detector_scores = {0: 0.8, 10: 0.7, 33: 0.0}
    found_again.detector_scores = {33: 0.6}
    (one,) = joined([lingering, found_again])
    assert spans([one]) == [(0, 69)]
    assert one.rows[35].bbox[0] == 380  # where he is, not where the first track lingers
    found_again = track(range(36, 70), 420, RED)
    lingering.detector_scores = {0: 0.8, 10: 0.7, 30: 0.0}  # nobody looked since the other began
    assert spans(joined([lingering, found_again])) == [(0, 69)]
    seen_still, other = track(range(0, 40), 300, RED), track(range(32, 70), 420, RED)
    seen_still.detector_scores = {0: 0.8, 33: 0.5}
    assert len(joined([seen_still, other])) == 2


def test_whoever_enters_long_after_another_left_is_a_new_person() -> None:
    assert len(joined([track(range(0, 30), 300, RED), track(range(400, 430), 300, RED)])) == 2


def test_who_runs_out_of_the_picture_is_nobody_who_is_found_within_it() -> None:
    def gone() -> TrackBuilder:
        left = track(range(0, 29), 1250, RED)
        left.add(29, seen_at(1290))
        return left

    assert len(joined([gone(), track(range(40, 70), 1200, RED)])) == 2
    assert len(joined([gone(), track(range(80, 110), 1200, RED)])) == 2
    assert spans(joined([gone(), track(range(40, 70), 1250, RED)])) == [(0, 69)]  # first seen at the edge: he came back
    assert spans(joined([track(range(0, 30), 1250, RED), track(range(40, 70), 1200, RED)])) == [(0, 69)]


def test_in_a_crowd_in_the_same_clothes_who_is_found_too_far_away_is_another() -> None:
    walker, near, far = (
        track(frames, x, RED) for frames, x in ((range(0, 30), 300), (range(39, 70), 340), (range(39, 70), 470))
    )
    crowd = [track(range(0, 90), 900 + 40 * k, BLUE) for k in range(8)]
    assert len(joined([walker, near, *crowd])) == 9  # 0.2 sides of his region in 0.3 s
    assert len(joined([walker, far, *crowd])) == 10  # 0.85


def test_tracks_that_take_turns_on_one_body_are_one() -> None:
    def by_turns(other_x: float, colours: np.ndarray) -> list[TrackBuilder]:
        first, second = track(range(0, 60), 300, RED), track(range(20, 60), other_x, colours)
        for frame in range(20, 60):
            del (first if frame % 8 < 4 else second).rows[frame]
        return joined([first, second])

    (one,) = by_turns(304, RED)
    assert sorted(one.rows) == list(range(60)) and one.rows[24].bbox[0] == 264
    assert len(by_turns(330, RED)) == 2  # beside him
    assert len(by_turns(304, BLUE)) == 2  # in other clothes: behind him


def test_a_track_that_moved_on_to_somebody_else_is_cut_where_the_clothes_change() -> None:
    mixed = track(range(0, 60), 300, RED)
    for frame in range(30, 60, 5):
        mixed.colours[frame] = BLUE
        mixed.parts[frame] = UNSEEN
    assert spans(untangled([mixed])) == [(0, 29), (30, 59)]


def test_a_track_that_leaps_to_somebody_else_is_cut_there_and_one_that_runs_is_not() -> None:
    def moving(x: Callable[[int], float]) -> TrackBuilder:
        result = TrackBuilder(TIME_S, upright_at(x(0)), 0)
        for frame in range(40):
            result.add(frame, upright_at(x(frame)))
            if frame % 5 == 0:
                result.colours[frame], result.parts[frame] = RED, UNSEEN
        return result

    leaps, runs = (lambda f: 300.0 + 90 * (f >= 15)), (lambda f: 300.0 + 20 * f)
    assert spans(untangled([moving(leaps)])) == [(0, 14), (15, 39)]
    assert spans(untangled([moving(runs)])) == [(0, 39)]
    assert spans(untangled([moving(lambda f: runs(f) + 30 * (f >= 15))])) == [(0, 39)]  # a frame that is shown late


def test_how_long_somebody_was_away_is_measured_in_seconds() -> None:
    stalled = TIME_S + np.where(np.arange(500) >= 35, 12.0, 0.0)  # ten frames, but 12 s
    pair = [track(range(0, 30), 300, RED, stalled), track(range(40, 70), 330, RED, stalled)]
    assert len(joined(pair)) == 2
    quick = np.arange(500) / 500  # 370 frames, but 0.74 s
    assert spans(joined([track(range(0, 30), 300, RED, quick), track(range(400, 430), 300, RED, quick)])) == [(0, 429)]


def test_who_comes_in_after_somebody_in_the_same_colours_but_other_parts_is_another() -> None:
    one, other = (np.random.default_rng(seed).uniform([10, -40, -40], [90, 40, 40], (9, 3)) for seed in (0, 1))
    first, second = (in_parts(track(frames, 300, RED), one) for frames in (range(0, 30), range(85, 110)))
    stranger = in_parts(track(range(85, 110), 300, RED), other)
    assert spans(joined([first, second])) == [(0, 109)]  # behind something for two seconds
    assert len(joined([in_parts(track(range(0, 30), 300, RED), one), stranger])) == 2


def test_whoever_is_found_anew_takes_back_what_a_track_showed_of_him_before_it_went_on_to_another() -> None:
    alike = 0.6 * RED + 0.4 * BLUE  # no change of clothes by itself
    went_on = track(range(0, 90), 300, RED)
    for frame in range(30, 90, 5):
        went_on.colours[frame] = alike
    assert spans(untangled([went_on])) == [(0, 89)]  # there is nobody else
    assert spans(untangled([went_on, track(range(40, 90), 600, RED)])) == [(0, 89), (40, 89)]  # not beside him
    assert spans(joined(untangled([went_on, track(range(40, 90), 330, RED)]))) == [(0, 89), (30, 89)]
    both_red = [track(range(0, 90), 300, RED), track(range(40, 90), 330, RED)]
    assert spans(joined(untangled(both_red))) == [(0, 89), (40, 89)]
