"""The shipped lifter on tracks: pieces join exactly, sides stay as they are named."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.perception.interfaces import PersonFrames
from humanmm.models.perception.lifting import lift as lifting
from humanmm.models.perception.lifting import reading
from humanmm.models.perception.lifting.features import certainty_of
from humanmm.models.perception.lifting.keypoints import COCO, PLACED, read_keypoints
from humanmm.models.perception.lifting.lift import KEYPOINT_LIFTER, lift
from humanmm.models.perception.lifting.reading import Reading, with_sides_put_right
from humanmm.models.records.landmarks import INDEX, SWAP
from humanmm.models.records.tracks import UNKNOWN_RAD, PoseEstimates

K = np.array([[600.0, 0, 320], [0, 600, 180], [0, 0, 1]])


def somebody(n: int) -> PersonFrames:
    """Landmarks of a standing body that sways, seen from the front."""
    rng = np.random.default_rng(0)
    height = np.concatenate(
        [np.full(11, 0.6), np.full(2, 0.45), [0.2, 0.2], np.zeros(8), [0, 0], [-0.4, -0.4], [-0.8] * 6]
    )
    across = np.array([0.1 if k % 2 else -0.1 for k in range(33)])
    body = np.stack([across, -height, np.zeros(33)], axis=1)
    time_s = np.arange(n) / 30
    landmarks = body + 0.05 * np.sin(2 * time_s)[:, None, None] + rng.normal(0, 0.01, (n, 33, 3))
    pixels = np.array([320.0, 180.0]) + 120 * landmarks[..., :2]
    keypoints = np.concatenate([pixels, np.full((n, 33, 1), 0.9)], axis=-1)
    return PersonFrames(time_s, keypoints, landmarks, np.tile([320.0, 180.0], (n, 1)), np.full(n, 300.0))


def named(frames: PersonFrames) -> np.ndarray:
    """COCO's keypoints, all of them seen."""
    return np.concatenate([frames.keypoints[:, COCO, :2], np.ones((len(frames.time_s), len(COCO), 1))], axis=-1)


def test_certainty_falls_with_the_logarithm_of_the_expected_error() -> None:
    found = certainty_of(np.array([1e-4, 0.0026, 0.02, 0.025, 0.2, 3.0]))
    assert found[0] == found[1] == 1.0 and found[4] == found[5] == 1e-3
    assert found[2] > PLACED > certainty_of(np.array(0.03)), "0.04 of the height is 0.025 of the crop's side"


def test_a_long_track_is_lifted_in_pieces_as_if_it_were_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    frames = somebody(480)
    pieces = lift(frames, K)
    monkeypatch.setattr(reading, "CHUNK_S", 1000.0)
    monkeypatch.setattr(reading, "CHUNK_FRAMES", 1000)
    whole = lift(frames, K)
    assert np.abs(pieces.landmarks3d - whole.landmarks3d).max() < 1e-5
    assert pieces.pose is not None and whole.pose is not None
    assert np.abs(pieces.pose.vectors - whole.pose.vectors).max() < 1e-4


def test_landmarks_stay_named_as_they_are_given() -> None:
    """With left and right swapped in the input they are swapped in the output: who is right decides later."""
    frames = somebody(20)
    swapped = replace(frames, keypoints=frames.keypoints[:, SWAP], landmarks3d=frames.landmarks3d[:, SWAP])
    one, other = lift(frames, K).landmarks3d, lift(swapped, K).landmarks3d
    same, crossed = (np.linalg.norm((other - x)[:, 11:29], axis=-1).mean() for x in (one[:, SWAP], one))
    assert same < crossed


def test_the_keypoint_lifter_sees_what_is_placed_and_not_what_is_visible(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[np.ndarray] = []

    def read(keypoints: np.ndarray, time_s: np.ndarray, K: np.ndarray) -> Reading:
        given.append(keypoints[..., 2])
        return read_keypoints(keypoints, time_s, K)

    monkeypatch.setattr(lifting, "read_keypoints", read)
    frames, nose = somebody(4), INDEX["nose"]
    sigma = np.full((4, 33), 0.01 * 300)
    sigma[:, nose] = 0.1 * 300
    for errors in (sigma, None):
        lift(replace(frames, keypoint_sigma=errors), K)
    expected = np.ones((4, 17))
    expected[:, COCO.index(nose)] = 0
    np.testing.assert_array_equal(given[0], expected)
    np.testing.assert_array_equal(given[1], np.ones((4, 17)))


def test_hands_and_feet_go_where_the_keypoint_lifter_has_wrists_and_ankles(monkeypatch: pytest.MonkeyPatch) -> None:
    """It sees nothing of fingers and toes itself."""
    frames, ankle = somebody(20), INDEX["left_ankle"]
    say = read_keypoints(named(frames), frames.time_s, K)

    def with_ankle_moved(by: float) -> np.ndarray:
        moved = say.landmarks3d.copy()
        moved[:, ankle, 2] += by
        monkeypatch.setattr(lifting, "_from_keypoints", lambda *_: say._replace(landmarks3d=moved))
        return lift(frames, K).landmarks3d

    shift = with_ankle_moved(0.4) - with_ankle_moved(0.0)
    foot = [ankle, INDEX["left_heel"], INDEX["left_foot_index"]]
    np.testing.assert_allclose(shift[:, foot], np.broadcast_to([0, 0, 0.4 * KEYPOINT_LIFTER], (20, 3, 3)), atol=0.02)
    assert np.abs(np.delete(shift, foot, axis=1)).max() < 1e-6


def test_the_keypoint_lifter_is_shown_sides_put_right(monkeypatch: pytest.MonkeyPatch) -> None:
    frames, are_swapped = somebody(20), np.arange(20) >= 8
    shown: list[np.ndarray] = []
    pose = read_keypoints(named(frames), frames.time_s, K).pose

    def say(keypoints: np.ndarray, *_: object) -> Reading:
        shown.append(keypoints)
        return Reading(np.tile(np.arange(33.0)[:, None], (20, 1, 3)), pose)

    monkeypatch.setattr(lifting, "read_keypoints", say)
    found, rotations = lifting._from_keypoints(frames, are_swapped, K)
    swapped = replace(frames, keypoints=frames.keypoints[:, SWAP])
    np.testing.assert_array_equal(shown[0][:8], named(frames)[:8])
    np.testing.assert_array_equal(shown[0][8:], named(swapped)[8:])
    np.testing.assert_allclose(found[8:], found[:1, SWAP].repeat(12, axis=0), atol=1e-6)
    np.testing.assert_array_equal(rotations.sigma, pose.sigma)


def test_where_sides_are_held_for_swapped_a_lifter_looks_again_with_them_put_right() -> None:
    odds, shown = np.array([-2.0, 3.0, -1.0]), []

    def read(are_swapped: np.ndarray) -> Reading:
        shown.append(are_swapped.tolist())
        landmarks = np.tile(np.arange(33.0)[:, None] + 100 * len(shown), (3, 1, 3))
        return Reading(landmarks, PoseEstimates(np.full((3, 20, 3), len(shown)), np.ones((3, 20)), odds / len(shown)))

    found = with_sides_put_right(read, 3)
    assert shown == [[False] * 3, [False, True, False]]
    np.testing.assert_array_equal(found.landmarks3d[0], 200 + np.arange(33.0)[:, None].repeat(3, axis=1))
    np.testing.assert_array_equal(found.landmarks3d[1], found.landmarks3d[0][SWAP])
    np.testing.assert_array_equal(found.pose.swap_odds, odds)
    assert (found.pose.vectors == 2).all() and (found.pose.sigma_as_named[1] == UNKNOWN_RAD).all()


def test_a_gap_of_ten_years_and_equal_time_stamps_cost_no_more_than_their_frames() -> None:
    frames = somebody(40)
    time_s = frames.time_s.copy()
    time_s[20:] += 3e8
    time_s[:5] = 0.0
    found = lift(replace(frames, time_s=time_s), K)
    assert found.landmarks3d.shape == (40, 33, 3) and np.isfinite(found.landmarks3d).all()
    assert len(list(reading.pieces(np.zeros(2000), 5.0))) == 4
    assert max(seen.stop - seen.start for _, seen in reading.pieces(np.zeros(5000), 5.0)) == 2048
