"""A track being built from frames at irregular times."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.perception.clothing import HISTOGRAM_BINS
from humanmm.models.perception.hands.follow import NUMBERS
from humanmm.models.perception.observation import Observation
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import Region
from humanmm.models.perception.tracking.track_builder import STEADINESS_UNKNOWN, TrackBuilder, steadiness
from humanmm.models.records.landmarks import SWAP
from humanmm.models.records.tracks import PersonTrack

STEPS_S = np.random.default_rng(5).choice([0.01, 0.02, 0.05, 0.12], 80)
TIME_S = 3.0 + np.cumsum(STEPS_S)
MEAN_RATE_TIME_S = 3.0 + np.arange(80) * STEPS_S.mean()
SPEED_PX_S = 150.0
SIDE_PX = 200.0
BLACK = Picture((np.zeros((4, 4), np.uint8), np.zeros((2, 2), np.uint8), np.zeros((2, 2), np.uint8)))
POSE = np.concatenate([np.random.default_rng(6).normal(0, 40, (33, 2)), np.ones((33, 1))], axis=1)


def at(frame: int) -> Observation:
    """A body that moves to the right at SPEED_PX_S."""
    x = 300.0 + SPEED_PX_S * TIME_S[frame]
    region = Region(x, 200.0, SIDE_PX)
    keypoints = POSE + np.array([x, 200.0, 0.0])
    solid = np.random.default_rng(7).normal(0, 0.3, (33, 3))
    return Observation(keypoints, solid, np.array([x, 0, x, 0]), 0.9, np.zeros((128, 128), np.uint8), region, region)


def built(frames: range, time_s: np.ndarray = TIME_S) -> TrackBuilder:
    track = TrackBuilder(time_s, at(frames[0]), frames[0])
    for frame in frames:
        track.add(frame, at(frame))
    return track


def errors_px(time_s: np.ndarray, frames: range) -> np.ndarray:
    """How far each frame's predicted region lies from where the body is."""
    track, found = TrackBuilder(time_s, at(frames[0]), frames[0]), []
    for frame in frames:
        found.append(abs(track.predicted(frame).x - at(frame).region.x))
        track.add(frame, at(frame))
    return np.array(found[2:])


@pytest.mark.parametrize("frames", [range(10, 70), range(70, 10, -1)])
def test_the_next_region_is_predicted_exactly_whatever_the_time_between_frames(frames: range) -> None:
    assert errors_px(TIME_S, frames).max() < 1e-9
    assert errors_px(MEAN_RATE_TIME_S, frames).max() > 10  # as if all frames were equally far apart


def test_a_lost_persons_motion_fades() -> None:
    track = built(range(10, 20))
    moved = [track.predicted(frame).x - at(19).region.x for frame in range(20, 60)]
    straight = SPEED_PX_S * (TIME_S[20:60] - TIME_S[19])
    assert moved[0] == pytest.approx(straight[0])
    assert (np.array(moved[1:]) < straight[1:]).all()


def test_seconds_seen_are_those_of_the_frames() -> None:
    track = built(range(10, 20))
    assert track.seen_s == pytest.approx(TIME_S[20] - TIME_S[10])
    first, second = track.split(14)
    assert first.seen_s + second.seen_s == pytest.approx(track.seen_s)


def test_uniform_motion_is_steady_at_irregular_times_and_a_jumping_body_is_not() -> None:
    frames = np.arange(80)
    keypoints = np.stack([at(frame).keypoints for frame in frames])
    side = np.full(80, SIDE_PX)
    assert steadiness(keypoints, frames, side, TIME_S).min() > 1 - 1e-9
    assert steadiness(keypoints, frames, side, MEAN_RATE_TIME_S).min() < 0.97
    jumping = keypoints + np.random.default_rng(8).normal(0, 0.2 * SIDE_PX, keypoints.shape)
    assert steadiness(jumping, frames, side, TIME_S).max() < 0.5


def test_steadiness_is_the_second_difference_where_frames_are_evenly_apart() -> None:
    frames, side = np.arange(40), np.full(40, SIDE_PX)
    keypoints = POSE + np.zeros((40, 1, 3))
    keypoints[::2, :, 0] += 0.02 * SIDE_PX  # second differences of ±0.04 of the side
    found = steadiness(keypoints, frames, side, np.arange(40) / 30)
    np.testing.assert_allclose(found, np.exp(-((0.04 / 0.07) ** 2)))
    # at 10 Hz a body may move three times as far between frames
    np.testing.assert_allclose(steadiness(keypoints, frames, side, np.arange(40) / 10), found ** (1 / 9))
    assert (steadiness(keypoints[:2], frames[:2], side[:2], np.arange(2) / 30) == STEADINESS_UNKNOWN).all()


def test_a_finished_track_is_in_order_with_left_and_right_named_alike() -> None:
    track, sigma = TrackBuilder(np.arange(80) / 30, at(30), 30), np.arange(33.0)
    for frame in [*range(30, 40), *range(29, 19, -1)]:
        seen = replace(at(30), keypoint_sigma=sigma, side_odds=1.0 if frame < 33 else -2.0)
        if 33 <= frame < 37:
            seen = Observation(seen.keypoints[SWAP], seen.landmarks3d[SWAP], seen.bbox, 0.9, seen.mask, seen.region,
                               seen.next_region, sigma[SWAP], seen.side_odds)  # fmt: skip
        track.add(frame, seen)
    track.detector_sides[21] = 0.5
    track.colours[30] = np.ones(HISTOGRAM_BINS)
    track.parts[30] = np.full((9, 3), np.nan)
    finished = track.finished()
    np.testing.assert_array_equal(finished.frame, np.arange(20, 40))
    assert finished.side_odds is not None
    np.testing.assert_array_equal(finished.side_odds, [1, 1.5, *[1] * 11, *[2] * 4, *[-2] * 3])
    np.testing.assert_allclose(finished.keypoints2d, np.tile(at(30).keypoints, (20, 1, 1)), rtol=1e-6)
    assert finished.keypoint_sigma is not None
    np.testing.assert_array_equal(finished.keypoint_sigma, np.tile(sigma, (20, 1)))
    assert not track.rows


def test_a_track_has_no_errors_of_keypoints_where_one_look_has_none() -> None:
    track = TrackBuilder(np.arange(80) / 30, at(30), 30)
    track.add(30, replace(at(30), keypoint_sigma=np.ones(33)))
    track.add(31, at(31))
    track.colours[30] = np.ones(HISTOGRAM_BINS)
    track.parts[30] = np.full((9, 3), np.nan)
    assert track.finished().keypoint_sigma is None


def test_hands_that_were_looked_at_are_in_the_track_and_change_sides_with_the_body(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    due = np.zeros((80, 2), bool)
    due[10:20:2, 0] = due[11:20:2, 1] = True
    known: list[int] = []

    def look(image: object, keypoints: object, wanted: np.ndarray, before: list[object]) -> np.ndarray:
        known.append(len(before))
        looks = np.full((2, NUMBERS), 0.5, np.float32)
        looks[~wanted, 0] = np.nan
        return looks

    monkeypatch.setattr("humanmm.models.perception.tracking.track_builder.look_at_hands", look)
    track = TrackBuilder(TIME_S, at(10), 10)
    for frame in range(10, 20):
        track.add(frame, at(frame))
        track.note_colours(frame, BLACK)
        track.look_at_hands(frame, BLACK, due)
    assert known == [0, 1, 2, 2, 2, 2, 2, 2, 2, 2]
    first, second = track.split(14)
    assert sorted(first.hands) == [10, 11, 12, 13] and min(second.hands) == 14
    hands = track.finished().hands
    assert hands is not None
    assert np.flatnonzero(hands.confidence[:, 0] > 0).tolist() == [0, 2, 4, 6, 8]
    assert built_without_hands().hands is None


def test_own_motion_is_measured_over_a_second_and_goes_with_the_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    compared: list[tuple[float, float]] = []
    time_s = np.arange(80) / 20

    def moved(before: float, after: float) -> float:
        compared.append((before, after))
        return 0.5

    builder = "humanmm.models.perception.tracking.track_builder.own_motion"
    track = TrackBuilder(time_s, at(10), 10)
    monkeypatch.setattr(f"{builder}.own_motion", moved)
    for frame in range(10, 60):
        monkeypatch.setattr(f"{builder}.look", lambda image, seen, frame=frame: time_s[frame])
        track.add(frame, at(frame))
        track.note_own_motion(frame, BLACK)
    assert [round(after - before, 3) for before, after in compared] == [0.4, 0.8, 1.2, 1.2, 1.2, 1.2]
    assert sorted(track.own_motions) == [26, 34, 42, 50, 58]  # after 0.4 s nobody has to have moved
    track.forget_appearance(58)
    first, second = track.split(40)
    assert sorted(first.own_motions) == [26, 34] and sorted(second.own_motions) == [42, 50]


def built_without_hands() -> PersonTrack:
    track = TrackBuilder(TIME_S, at(10), 10)
    for frame in range(10, 20):
        track.add(frame, at(frame))
        track.note_colours(frame, BLACK)
        track.look_at_hands(frame, BLACK, None)
    return track.finished()


def test_the_part_in_which_the_detector_sees_somebody_ends_with_the_first_search_that_does_not() -> None:
    track = built(range(10, 70))
    assert track.where_detected() is None  # it never looked
    track.detector_scores = {12: 0.0, 20: 0.5, 30: 0.0, 40: 0.6, 50: 0.0, 60: 0.0}
    part = track.where_detected()
    assert part is not None and (min(part.rows), max(part.rows)) == (13, 49)
    assert len(track.rows) == 60
    track.detector_scores = {20: 0.5, 40: 0.6}
    assert track.where_detected() is None  # all of it
