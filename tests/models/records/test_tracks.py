"""Tracks: masks, and left and right put right."""

from dataclasses import replace

import numpy as np

from humanmm.models.records.hands import HandTracks
from humanmm.models.records.landmarks import NUM_LANDMARKS, SWAP
from humanmm.models.records.shots import Appearance, TrackPart
from humanmm.models.records.tracks import PersonTrack, ScenePeople, Silhouettes

FRAMES = np.array([4, 5, 7, 8, 9, 20], np.int32)


def track() -> PersonTrack:
    rng, count = np.random.default_rng(0), len(FRAMES)
    return PersonTrack(
        frame=FRAMES,
        keypoints2d=rng.random((count, NUM_LANDMARKS, 3), np.float32),
        landmarks3d=rng.random((count, NUM_LANDMARKS, 3), np.float32),
        bbox=rng.random((count, 4), np.float32),
        confidence=np.ones(count, np.float32),
        masks=Silhouettes.pack(rng.random((count, 128, 128)) > 0.5),
        mask_affine=np.zeros((count, 2, 3), np.float32),
        color_frame=np.zeros(0, np.int32),
        color_histogram=np.zeros((0, 8), np.float32),
    )


def test_a_person_in_a_shot_has_left_and_right_put_right_in_the_marked_frames_alone() -> None:
    people = ScenePeople(0, 30, (track(), replace(track(), confidence=np.zeros(6, np.float32))))
    right = people.track_of(Appearance(0, 1, left_right_swapped=((5, 8), (19, 30))))
    swapped = np.array([False, True, True, False, False, True])
    for name in ("keypoints2d", "landmarks3d"):
        before, after = getattr(people.tracks[1], name), getattr(right, name)
        np.testing.assert_array_equal(after[~swapped], before[~swapped])
        np.testing.assert_array_equal(after[swapped], before[swapped][:, SWAP])
        assert after.dtype == np.float32
    assert right.masks is people.tracks[1].masks


def test_a_track_without_swaps_is_handed_out_as_it_is_and_others_are_copied_once() -> None:
    people = ScenePeople(0, 30, (track(),))
    assert people.track_of(Appearance(0, 0, tracking_failures=((4, 6),))) is people.tracks[0]
    swapped = Appearance(0, 0, left_right_swapped=((5, 8),))
    assert people.track_of(swapped) is people.track_of(replace(swapped, person=3))


def test_swapping_twice_gives_the_track_back() -> None:
    twice = track().with_sides_swapped(((4, 9),)).with_sides_swapped(((4, 9),))
    np.testing.assert_array_equal(twice.keypoints2d, track().keypoints2d)


def test_masks_come_back_as_they_were_packed() -> None:
    masks = np.random.default_rng(1).random((3, 128, 128)) > 0.3
    packed = Silhouettes.pack(masks[:1]).then(Silhouettes.pack(masks[1:])).chosen(np.array([2, 0]))
    np.testing.assert_array_equal([packed.mask(0), packed.mask(1)], masks[[2, 0]])


def test_a_person_who_was_taken_for_another_is_put_together_from_parts_of_both_tracks() -> None:
    other = replace(track(), frame=FRAMES + 1, bbox=track().bbox + 100, probability=0.5)
    people = ScenePeople(0, 30, (track(), other))
    parts = (TrackPart(1, 8, 11), TrackPart(0, 4, 8), TrackPart(0, 20, 30))
    whole = people.track_of(Appearance(0, 0, parts=parts, left_right_swapped=((8, 10),)))
    np.testing.assert_array_equal(whole.frame, [4, 5, 7, 8, 9, 10, 20])
    rows = ((0, 0), (0, 1), (0, 2), (1, 2), (1, 3), (1, 4), (0, 5))
    for row, (number, source) in enumerate(rows):
        np.testing.assert_array_equal(whole.bbox[row], people.tracks[number].bbox[source])
        np.testing.assert_array_equal(whole.masks.mask(row), people.tracks[number].masks.mask(source))
    np.testing.assert_array_equal(whole.keypoints2d[3], other.keypoints2d[2][SWAP])
    np.testing.assert_array_equal(whole.keypoints2d[5], other.keypoints2d[4])
    assert 0.5 < whole.probability < 1.0


def test_parts_of_which_one_was_not_looked_at_for_hands_go_together() -> None:
    seen = replace(
        track(), hands=HandTracks(np.ones((6, 2), np.float32), *(np.ones((6, 2, 21, k), np.float32) for k in (2, 3)))
    )
    whole = seen.then(track())
    assert whole.hands is not None
    assert (whole.hands.confidence[:6] == 1).all() and np.isnan(whole.hands.confidence[6:]).all()
    assert track().then(track()).hands is None
