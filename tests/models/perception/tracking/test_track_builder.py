"""A track being built from frames at irregular times."""

import numpy as np
import pytest

from humanmm.models.perception.clothing import HISTOGRAM_BINS
from humanmm.models.perception.observation import Observation
from humanmm.models.perception.regions import Region
from humanmm.models.perception.tracking.track_builder import STEADINESS_UNKNOWN, TrackBuilder, steadiness
from humanmm.models.records.landmarks import SWAP

STEPS_S = np.random.default_rng(5).choice([0.01, 0.02, 0.05, 0.12], 80)
TIME_S = 3.0 + np.cumsum(STEPS_S)
MEAN_RATE_TIME_S = 3.0 + np.arange(80) * STEPS_S.mean()
SPEED_PX_S = 150.0
SIDE_PX = 200.0
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
    track = TrackBuilder(np.arange(80) / 30, at(30), 30)
    for frame in [*range(30, 40), *range(29, 19, -1)]:
        seen = at(30)
        if 33 <= frame < 37:
            seen = Observation(seen.keypoints[SWAP], seen.landmarks3d[SWAP], seen.bbox, 0.9, seen.mask, seen.region,
                               seen.next_region)  # fmt: skip
        track.add(frame, seen)
    track.colours[30] = np.ones(HISTOGRAM_BINS)
    track.parts[30] = np.full((9, 3), np.nan)
    finished = track.finished()
    np.testing.assert_array_equal(finished.frame, np.arange(20, 40))
    np.testing.assert_allclose(finished.keypoints2d, np.tile(at(30).keypoints, (20, 1, 1)), rtol=1e-6)
    assert not track.rows
