"""Who is who across cuts."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.perception.clothing import HISTOGRAM_BINS
from humanmm.models.records.landmarks import INDEX, NUM_LANDMARKS
from humanmm.models.records.shots import Appearance, Shot, Transition
from humanmm.models.records.tracks import PersonTrack, PoseEstimates, ScenePeople, Silhouettes
from humanmm.models.shots import identity
from humanmm.models.shots.identity import Candidate, Cast, matched_people, pose_at
from humanmm.models.shots.same_pose import LEAST, same_pose_odds

TIME_S = np.arange(150) / 30
RED, BLUE, GREEN = (np.eye(HISTOGRAM_BINS)[k] for k in (3, 17, 30))


def identify(shots: list[Shot], people: list[ScenePeople | None], *, time_s: np.ndarray) -> Cast:
    """The people of some shots, numbered."""
    found = matched_people(shots, people, time_s=time_s)
    return identity.cast_of([Candidate(tuple(person)) for person in found], len(shots))


def standing(arm: float = 0.0) -> np.ndarray:
    """A body with its left forearm turned by an angle, landmarks in metres (x right, y down, z away)."""
    pose = np.zeros((NUM_LANDMARKS, 3))
    for joint, height, width in (("shoulder", -0.5, 0.17), ("elbow", -0.24, 0.22), ("wrist", 0.0, 0.25),
                                 ("hip", 0.0, 0.11), ("knee", 0.4, 0.12), ("ankle", 0.78, 0.12)):  # fmt: skip
        for side, sign in (("left", 1), ("right", -1)):
            pose[INDEX[f"{side}_{joint}"]] = [sign * width, height, 0.02]
    elbow = pose[INDEX["left_elbow"]]
    pose[INDEX["left_wrist"]] = elbow + 0.24 * np.array([0.0, np.cos(arm), -np.sin(arm)])
    return pose


def track(
    first: int, last: int, colours: np.ndarray, *, size: float = 100.0, arm: float = 0.0, probability: float = 0.9
) -> PersonTrack:
    count = last - first
    box = np.array([10, 10, 10 + size / 2, 10 + size])
    noise = np.random.default_rng(first).random((3, HISTOGRAM_BINS)) / HISTOGRAM_BINS / 10
    histogram = colours + noise
    return PersonTrack(
        frame=np.arange(first, last, dtype=np.int32),
        keypoints2d=np.ones((count, NUM_LANDMARKS, 3), np.float32),
        landmarks3d=np.repeat(standing(arm)[None], count, axis=0).astype(np.float32),
        bbox=np.repeat(box[None], count, axis=0).astype(np.float32),
        confidence=np.full(count, 0.9, np.float32),
        masks=Silhouettes.pack(np.zeros((count, 128, 128))),
        mask_affine=np.zeros((count, 2, 3), np.float32),
        color_frame=np.linspace(first, last - 1, 3).astype(np.int32),
        color_histogram=(histogram / histogram.sum(axis=1, keepdims=True)).astype(np.float32),
        probability=probability,
    )


def cast_of(*scenes: list[PersonTrack] | None, length: int = 30) -> list[list[tuple[int, int]]]:
    """(person, track) of every shot, one shot a scene."""
    spans = [Shot(k, k * length, (k + 1) * length, k, None, ()) for k in range(len(scenes))]
    people = [
        ScenePeople(span.start, span.end, tuple(tracks)) if tracks is not None else None
        for span, tracks in zip(spans, scenes, strict=True)
    ]
    cast = identify(spans, people, time_s=TIME_S)
    return [[(a.person, a.track) for a in sorted(shot, key=lambda a: a.person)] for shot in cast.appearances]


def test_bones_of_whom_a_lifter_lifted_are_those_between_landmarks_of_the_body() -> None:
    of_pictures, shot = track(0, 30, RED), Shot(0, 0, 30, 0, None, ())
    pose = PoseEstimates(np.zeros((30, 20, 3)), np.ones((30, 20)), np.zeros(30))
    found = [
        identity.sighting(0, shot, 0, one, TIME_S)
        for one in (of_pictures, replace(of_pictures, pose=pose), replace(of_pictures, lifted=True))
    ]
    seen, lifted, of_keypoints = (one.bones.mean(axis=0) for one in found if one is not None)
    np.testing.assert_array_equal(lifted, of_keypoints)
    assert np.log(lifted / seen).mean() < -0.03, "a pose network sees bones shorter than landmarks are apart"


def test_one_person_keeps_the_number_across_cuts() -> None:
    assert cast_of([track(0, 30, RED)], [track(30, 60, RED)], [track(60, 90, RED)]) == [[(0, 0)]] * 3


def test_numbers_that_the_user_trusts_decide_who_is_who() -> None:
    first = [replace(track(0, 30, RED), number=4), replace(track(0, 30, BLUE), number=7)]
    second = [replace(track(30, 60, RED), number=7), replace(track(30, 60, BLUE), number=4)]
    assert cast_of(first, second) == [[(0, 0), (1, 1)], [(0, 1), (1, 0)]], "against all colours"
    new = [replace(track(30, 60, RED), number=9)]
    assert cast_of(first, new) == [[(0, 0), (1, 1)], [(2, 0)]]
    people = [ScenePeople(30 * k, 30 * (k + 1), tuple(one)) for k, one in enumerate((first, second))]
    shots = [
        Shot(k, 30 * k, 30 * (k + 1), k, None, tuple(Appearance(person, track) for person, track in here))
        for k, here in enumerate(([(0, 0), (1, 1)], [(0, 1), (1, 0)]))
    ]
    found = identity.identity_answers(shots, people, TIME_S)
    assert {who: one.probability for who, one in found.items()} == pytest.approx({(0, 1): 1.0, (1, 1): 1.0}, abs=1e-6)


def test_two_people_who_change_places_in_the_track_order_are_not_confused() -> None:
    first = [track(0, 30, RED, size=120), track(0, 30, BLUE)]
    second = [track(30, 60, BLUE), track(30, 60, RED, size=120)]
    assert cast_of(first, second) == [[(0, 0), (1, 1)], [(0, 1), (1, 0)]]


def test_somebody_in_other_clothes_after_the_cut_is_a_new_person() -> None:
    assert cast_of([track(0, 30, RED, size=120)], [track(30, 60, BLUE)]) == [[(0, 0)], [(1, 0)]]


def test_without_colours_nobody_becomes_a_stranger_by_his_pose_alone() -> None:
    """Keypoints without pictures: the poses on both sides of a cut may be lifted wrongly."""

    folded = standing()
    for side in ("left", "right"):
        folded[[INDEX[f"{side}_knee"], INDEX[f"{side}_ankle"]]] = folded[INDEX[f"{side}_hip"]] - [0, 0.1, 0.4]
        folded[[INDEX[f"{side}_elbow"], INDEX[f"{side}_wrist"]]] = folded[INDEX[f"{side}_shoulder"]] - [0, 0.4, 0.1]
    assert same_pose_odds(standing(), folded) == LEAST

    def colourless(first: int, last: int, pose: np.ndarray) -> PersonTrack:
        nothing = np.zeros((0, HISTOGRAM_BINS), np.float32)
        poses = np.repeat(pose[None], last - first, axis=0).astype(np.float32)
        seen = track(first, last, RED)
        return replace(seen, landmarks3d=poses, color_frame=np.zeros(0, np.int32), color_histogram=nothing)

    assert cast_of([colourless(0, 30, standing())], [colourless(30, 60, folded)]) == [[(0, 0)], [(0, 0)]]


def test_a_person_who_was_away_for_a_shot_is_recognised() -> None:
    shots = [[track(0, 30, RED, size=120)], [track(30, 60, BLUE)], None, [track(90, 120, RED, size=120)]]
    assert cast_of(*shots) == [[(0, 0)], [(1, 0)], [], [(0, 0)]]


def test_person_zero_has_the_largest_summed_area_not_the_first_appearance() -> None:
    assert cast_of([track(0, 30, RED, size=60)], [track(30, 60, BLUE, size=200)]) == [[(1, 0)], [(0, 0)]]


def test_who_is_seen_for_a_blink_or_is_hardly_a_person_is_left_out() -> None:
    people = [track(0, 30, RED), track(10, 14, BLUE), track(0, 30, GREEN, probability=0.1)]
    assert cast_of(people) == [[(0, 0)]]


def test_who_may_be_no_person_comes_last_and_a_better_view_of_him_counts() -> None:
    doubtful = [track(0, 30, RED, size=200, probability=0.3), track(0, 30, BLUE)]
    assert cast_of(doubtful) == [[(0, 1), (1, 0)]]
    seen_better = [track(30, 60, RED, size=200, probability=0.95)]
    assert cast_of(doubtful, seen_better) == [[(0, 0), (1, 1)], [(0, 0)]]


def test_a_track_that_spans_a_cut_inside_its_scene_gives_one_person_in_both_shots() -> None:
    people = ScenePeople(0, 60, (track(0, 60, RED),))
    cast = identify([Shot(0, 0, 30, 0, None, ()), Shot(1, 30, 60, 0, None, ())], [people], time_s=TIME_S)
    assert [[a.person for a in shot] for shot in cast.appearances] == [[0], [0]]


def test_who_is_seen_only_while_two_shots_mix_is_in_neither() -> None:
    dissolve = Transition("dissolve", 18, 42, "scene")
    shots = [Shot(0, 0, 30, 0, None, (), dissolve), Shot(1, 30, 60, 1, dissolve, ())]
    ghost = track(30, 42, GREEN)
    people = [ScenePeople(0, 30, (track(0, 30, RED),)), ScenePeople(30, 60, (ghost, track(30, 60, BLUE)))]
    cast = identify(shots, people, time_s=TIME_S)
    assert [[(a.person, a.track) for a in shot] for shot in cast.appearances] == [[(0, 0)], [(1, 1)]]


def test_the_pose_at_the_cut_tells_equally_dressed_people_apart() -> None:
    first = [track(0, 30, RED, size=120, arm=0.0), track(0, 30, RED, arm=2.8)]
    second = [track(30, 60, RED, arm=2.8), track(30, 60, RED, size=120, arm=0.0)]
    assert cast_of(first, second) == [[(0, 0), (1, 1)], [(0, 1), (1, 0)]]


def test_a_person_must_be_seen_for_seconds_not_for_frames() -> None:
    people = ScenePeople(0, 60, (track(0, 60, RED, size=120), track(10, 16, BLUE)))
    shots = [Shot(0, 0, 60, 0, None, ())]
    sixty_hz = np.arange(60) / 60
    stalled = sixty_hz + np.where(np.arange(60) >= 14, 0.4, 0.0)  # its fourth frame is shown for 0.4 s
    assert len(identify(shots, [people], time_s=sixty_hz).people) == 1
    assert len(identify(shots, [people], time_s=stalled).people) == 2


def test_a_pose_is_carried_to_the_cut_in_time() -> None:
    time_s = np.cumsum(np.random.default_rng(0).choice([0.01, 0.05, 0.1], 20))
    seen = track(0, 18, RED)
    velocity = np.random.default_rng(1).normal(0, 1, (NUM_LANDMARKS, 3))
    seen.landmarks3d[:] = standing() + velocity * time_s[:18, None, None]
    carried = pose_at(seen, np.arange(13, 18), 19, time_s)
    np.testing.assert_allclose(carried, standing() + velocity * time_s[19], atol=1e-5)


@pytest.mark.parametrize(("hz", "farthest"), [(10, 3), (24, 3), (30, 3), (50, 5), (60, 6), (120, 12)])
def test_a_pose_a_tenth_of_a_second_from_the_cut_is_that_at_the_cut(hz: int, farthest: int) -> None:
    seen, time_s = track(0, 18, RED), 100 + np.arange(40) / hz
    assert pose_at(seen, np.arange(13, 18), 17 + farthest, time_s) is not None
    assert pose_at(seen, np.arange(13, 18), 18 + farthest, time_s) is None
