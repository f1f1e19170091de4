from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.perception.between_looks import in_frames, looked_at, times_of
from humanmm.models.records.hands import not_looked
from humanmm.models.records.tracks import PersonTrack, ScenePeople, Silhouettes

RATE_HZ = 60.0
TIME_S = np.arange(100) / RATE_HZ
SPAN = (20, 80)


def track(looks: np.ndarray, seen: np.ndarray, place: np.ndarray) -> PersonTrack:
    """Somebody whose every number is `place` (a function of time) in the looks in which he is seen."""
    n = len(seen)
    masks = np.zeros((n, 128, 128), np.uint8)
    masks[np.arange(n), 0, np.arange(n)] = 1
    return PersonTrack(
        frame=seen.astype(np.int32),
        keypoints2d=np.broadcast_to(place[looks[seen], None, None], (n, 33, 3)).astype(np.float32),
        landmarks3d=np.broadcast_to(place[looks[seen], None, None], (n, 33, 3)).astype(np.float32),
        bbox=np.broadcast_to(place[looks[seen], None], (n, 4)).astype(np.float32),
        confidence=np.full(n, 0.9, np.float32),
        masks=Silhouettes.pack(masks),
        mask_affine=np.broadcast_to(place[looks[seen], None, None], (n, 2, 3)).astype(np.float32),
        color_frame=seen[:2].astype(np.int32),
        color_histogram=np.zeros((2, 8), np.float32),
    )


def test_no_more_frames_are_looked_at_than_asked_for_but_at_both_ends() -> None:
    looks = looked_at(TIME_S, SPAN, max_rate_hz=15, every=5)
    assert looks[0] == 20 and looks[-1] == 79
    assert set(range(20, 25)) | set(range(75, 80)) <= set(looks.tolist())
    inner = looks[(looks >= 24) & (looks < 75)]
    assert set(np.diff(inner).tolist()) == {4}


def test_every_frame_of_a_slower_video_is_looked_at() -> None:
    assert looked_at(TIME_S, SPAN, max_rate_hz=RATE_HZ, every=5).tolist() == list(range(*SPAN))
    assert looked_at(TIME_S[::2] * 2, (3, 9), max_rate_hz=30, every=2).tolist() == list(range(3, 9))


def test_the_last_look_counts_until_the_scene_ends() -> None:
    assert times_of(np.array([20, 24, 79]), 80, TIME_S) == pytest.approx([20 / 60, 24 / 60, 79 / 60, 80 / 60])
    assert np.diff(times_of(np.array([0]), 1, np.array([0.0, 0.04, 0.08]))) == pytest.approx([0.04])


def test_what_lies_between_two_looks_is_interpolated_and_what_lies_between_two_sightings_is_not() -> None:
    looks = looked_at(TIME_S, SPAN, max_rate_hz=15, every=1)  # 20, 24, …, 76, 79
    place = 0.5 + 0.4 * np.sin(2 * np.pi * 1.0 * TIME_S)
    seen = np.array([0, 1, 2, 3, 6, 7, 8, 9, 10, 15])  # unseen in the looks at 36, 40 and 64 to 76
    given = track(looks, seen, place)
    given = replace(given, keypoint_sigma=given.keypoints2d[..., 0])
    (result,) = in_frames(ScenePeople(0, len(looks), (given,)), looks, SPAN, TIME_S).tracks
    assert result.frame.tolist() == [*range(20, 33), *range(44, 61), 79]
    assert result.keypoint_sigma is not None
    for values in (result.keypoint_sigma, result.keypoints2d, result.landmarks3d, result.bbox, result.mask_affine):
        assert values.dtype == np.float32
        assert np.abs(values.reshape(len(values), -1) - place[result.frame, None]).max() < 0.02
    assert result.color_frame.tolist() == [20, 24]
    mask_of = [int(result.masks.mask(row)[0].argmax()) for row in range(len(result.frame))]
    assert mask_of[:6] == [0, 0, 0, 1, 1, 1], "the nearest look's, of two the earlier one's"
    assert mask_of[-1] == len(seen) - 1


def test_a_jump_is_not_overshot() -> None:
    looks = looked_at(TIME_S, SPAN, max_rate_hz=15, every=1)
    place = np.where(TIME_S < 50 / RATE_HZ, 0.0, 1.0)
    seen = np.arange(len(looks))
    (result,) = in_frames(ScenePeople(0, len(looks), (track(looks, seen, place),)), looks, SPAN, TIME_S).tracks
    assert result.landmarks3d.min() >= -1e-6 and result.landmarks3d.max() <= 1 + 1e-6


def test_between_two_looks_from_one_of_which_to_the_other_somebody_jumps_nothing_is_known() -> None:
    looks = looked_at(TIME_S, SPAN, max_rate_hz=15, every=1)
    seen = np.arange(len(looks))
    jump = np.where(TIME_S < 50 / RATE_HZ, 0.0, 30.0) + TIME_S
    error = np.where((TIME_S > 38 / RATE_HZ) & (TIME_S < 46 / RATE_HZ), 30.0, 0.0) + TIME_S  # in the looks at 40 and 44
    start = 20 * np.maximum(TIME_S - 50 / RATE_HZ, 0.0)  # from rest, and fast from then on
    frames = [
        in_frames(ScenePeople(0, len(looks), (track(looks, seen, place),)), looks, SPAN, TIME_S).tracks[0].frame
        for place in (jump, error, start)
    ]
    assert sorted({*range(20, 80)} - {*frames[0].tolist()}) == [49, 50, 51]
    assert sorted({*range(20, 80)} - {*frames[1].tolist()}) == [37, 38, 39, 45, 46, 47]
    assert frames[2].tolist() == list(range(20, 80))


def test_the_record_tells_looks_from_what_is_interpolated() -> None:
    for max_rate_hz, told in ((15, True), (RATE_HZ, False)):
        looks = looked_at(TIME_S, SPAN, max_rate_hz=max_rate_hz, every=1)
        people = in_frames(ScenePeople(0, len(looks), ()), looks, SPAN, TIME_S)
        assert (people.looks is not None) is told
        assert people.looks is None or people.looks.tolist() == looks.tolist()


def test_what_was_said_of_the_sides_counts_in_looks_alone() -> None:
    looks = looked_at(TIME_S, SPAN, max_rate_hz=30, every=1)
    seen = np.arange(6)
    one = replace(track(looks, seen, TIME_S), side_odds=np.full(6, 1.5, np.float32))
    (result,) = in_frames(ScenePeople(0, len(looks), (one,)), looks, SPAN, TIME_S).tracks
    assert result.side_odds is not None
    assert result.frame[result.side_odds != 0].tolist() == looks[seen].tolist()
    assert set(result.side_odds.tolist()) == {0.0, 1.5}


def test_hands_are_known_in_looks_alone() -> None:
    looks = looked_at(TIME_S, SPAN, max_rate_hz=30, every=1)
    seen = np.arange(len(looks))
    hands = not_looked(len(seen))
    hands.confidence[::3] = 0.7
    one = replace(track(looks, seen, TIME_S), hands=hands)
    (result,) = in_frames(ScenePeople(0, len(looks), (one,)), looks, SPAN, TIME_S).tracks
    assert result.hands is not None and len(result.hands.confidence) == len(result.frame)
    known = np.flatnonzero(np.isfinite(result.hands.confidence[:, 0]))
    assert result.frame[known].tolist() == looks[::3].tolist()
