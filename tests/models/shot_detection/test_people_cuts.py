"""People who jump show a cut; people who move, detectors that err and labels that swap do not."""

import dataclasses

import numpy as np
import pytest
from walkers import joined, looked_at_seldom, walker

from humanmm.models.perception.between_looks import looked_at
from humanmm.models.records.landmarks import SWAP
from humanmm.models.records.shots import Change, Scenes, Transition
from humanmm.models.records.tracks import PersonTrack, ScenePeople
from humanmm.models.shot_detection.people_cuts import Parts, cuts_in_scene, split_scenes

TIME_S = np.arange(90) / 30


def cuts(*tracks: PersonTrack, end: int = 60) -> list[tuple[int, str]]:
    return [(cut.start, cut.evidence) for cut in cuts_in_scene(ScenePeople(0, end, tracks), time_s=TIME_S)]


def test_a_walk_and_a_run_are_no_cuts() -> None:
    assert cuts(walker(0, 60, (100, 200))) == []
    assert cuts(walker(0, 60, (100, 200), speed_px=25)) == []


@pytest.mark.parametrize("same_track", [True, False])
def test_somebody_elsewhere_in_the_next_frame_is_a_cut_by_the_box(same_track: bool) -> None:
    before, after = walker(0, 30, (100, 200)), walker(30, 60, (500, 230), seed=1)
    tracks = [joined(before, after)] if same_track else [before, after]
    assert cuts(*tracks) == [(30, "bbox")]


def test_another_pose_in_an_overlapping_box_is_a_cut_by_the_keypoints() -> None:
    before, after = walker(0, 30, (100, 200), speed_px=0), walker(30, 60, (100, 255), speed_px=0, seed=1)
    assert cuts(joined(before, after)) == [(30, "keypoints")]


def test_a_cut_at_which_the_tracker_loses_everybody_for_some_frames_begins_where_they_are_lost() -> None:
    assert cuts(walker(0, 30, (100, 200)), walker(33, 60, (500, 230))) == [(30, "bbox")]


def test_whoever_carries_on_proves_that_the_camera_does() -> None:
    jumper = joined(walker(0, 30, (100, 200)), walker(30, 60, (500, 230), seed=1))
    assert cuts(jumper, walker(0, 60, (800, 200), seed=2)) == []


def test_swapped_left_and_right_are_no_cut() -> None:
    track = walker(0, 60, (100, 200))
    track.keypoints2d[30:] = track.keypoints2d[30:, SWAP]
    assert cuts(track) == []


def test_an_error_of_the_detector_is_no_cut() -> None:
    track = walker(0, 60, (100, 200))
    track.keypoints2d[30:33, :, :2] += 150
    track.bbox[30:33] += 150
    assert cuts(track) == []


def test_a_body_rotated_upside_down_is_no_cut() -> None:
    track = walker(0, 60, (100, 200), speed_px=0)
    track.keypoints2d[30:, :, 1] = 400 - track.keypoints2d[30:, :, 1]
    assert cuts(track) == []


def test_leaving_on_one_side_and_arriving_on_the_other_later_is_no_cut() -> None:
    assert cuts(walker(0, 30, (100, 200)), walker(40, 60, (500, 230))) == []


def test_what_the_colours_have_found_already_is_not_found_again() -> None:
    scenes = Scenes(60, (Transition("dissolve", 24, 34, "scene"),))
    people = [ScenePeople(0, 29, (walker(0, 29, (100, 200)),)), ScenePeople(29, 60, (walker(29, 60, (500, 230)),))]
    assert split_scenes(scenes, people, time_s=TIME_S).transitions == scenes.transitions
    assert split_scenes(scenes, [None, None], time_s=TIME_S).transitions == scenes.transitions


def test_parts_of_the_detector_that_are_off_find_nothing() -> None:
    scenes = Scenes(90, ())
    elsewhere = walker(0, 30, (100, 200)), walker(30, 60, (500, 230), speed_px=0, seed=1)
    track = joined(joined(*elsewhere), walker(60, 90, (500, 285), speed_px=0, seed=2))  # first by box, then by pose
    people = [ScenePeople(0, 90, (track,))]

    def starts(parts: Parts) -> list[int]:
        return [cut.start for cut in split_scenes(scenes, people, time_s=TIME_S, parts=parts).transitions]

    assert starts("keypoints") == [30, 60]
    assert starts("boxes") == [30]
    assert starts("scenes") == []


STALLED_S = np.full(60, 0.03)
STALLED_S[[20, 40]] = 0.6  # a recorder that stalls while somebody walks on
VARIABLE_TIME_S = np.cumsum(STALLED_S)


def runner(jump_px: float = 0.0) -> PersonTrack:
    """A person who runs at 200 px/s, and is somewhere else from frame 50 on."""
    track = walker(0, 60, (100, 200), speed_px=0)
    moved = 200 * VARIABLE_TIME_S + jump_px * (np.arange(60) >= 50)
    track.keypoints2d[..., 0] += moved[:, None]
    track.bbox[:, [0, 2]] += moved[:, None]
    return track


def test_who_walks_on_while_no_frame_is_taken_makes_no_cut_and_who_jumps_does() -> None:
    def starts(track: PersonTrack, time_s: np.ndarray) -> list[int]:
        return [cut.start for cut in cuts_in_scene(ScenePeople(0, 60, (track,)), time_s=time_s)]

    assert starts(runner(), VARIABLE_TIME_S) == []
    assert starts(runner(), np.arange(60) * STALLED_S.mean()) == [20, 40]  # as if frames were evenly apart
    assert starts(runner(jump_px=300), VARIABLE_TIME_S) == [50]


def test_a_gap_is_measured_in_seconds() -> None:
    tracks = walker(0, 30, (100, 200)), walker(33, 60, (500, 230))
    slow = TIME_S[:60] + np.where(np.arange(60) >= 31, 0.2, 0.0)  # nobody is seen for 0.3 s
    assert cuts(*tracks) == [(30, "bbox")]
    assert cuts_in_scene(ScenePeople(0, 60, tracks), time_s=slow) == []


@pytest.mark.parametrize(("probability", "found"), [(0.9, [(30, "bbox")]), (0.6, [])])
def test_what_may_be_nobody_shows_no_cut(probability: float, found: list[tuple[int, str]]) -> None:
    tracker_carried_on = joined(walker(0, 30, (200, 250)), walker(30, 60, (600, 250), seed=1))
    assert cuts(dataclasses.replace(tracker_carried_on, probability=probability)) == found


@pytest.mark.parametrize("same_track", [True, False])
@pytest.mark.parametrize(("rate_hz", "looks_hz"), [(24, 30), (30, 30), (50, 30), (60, 30), (120, 30), (30, 15)])
def test_a_cut_between_two_looks_is_in_the_middle_or_where_the_picture_changes(
    rate_hz: int, looks_hz: int, same_track: bool
) -> None:
    time_s = np.arange(2 * rate_hz) / rate_hz
    looks = looked_at(time_s, (0, len(time_s)), max_rate_hz=looks_hz, every=5)
    L, k = len(looks), len(looks) // 2
    between = range(int(looks[k - 1]) + 1, int(looks[k]) + 1)
    for place, evidence in (((500.0, 230.0), "bbox"), ((100.0, 255.0), "keypoints")):
        tracks = [walker(0, k, (100, 200), speed_px=0), walker(k, L, place, speed_px=0, seed=1)]
        people = looked_at_seldom(*([joined(*tracks)] if same_track else tracks), looks=looks, time_s=time_s)
        (cut,) = cuts_in_scene(people, time_s=time_s)
        assert cut.evidence == evidence and cut.start in between
        assert abs(cut.start - (between[0] + between[-1]) / 2) <= 0.5
        for frame in between:
            changes = (Change(frame, 1.2, (0.0, 0.0)), Change(between[-1] + 1, 3.0, (0.0, 0.0)))
            (transition,) = split_scenes(Scenes(len(time_s), (), changes=changes), [people], time_s=time_s).transitions
            assert transition == Transition("cut", frame, frame, evidence)


@pytest.mark.parametrize("rate_hz", [30, 60])
def test_who_moves_fast_between_two_looks_makes_no_cut(rate_hz: int) -> None:
    time_s = np.arange(2 * rate_hz) / rate_hz
    looks = looked_at(time_s, (0, len(time_s)), max_rate_hz=rate_hz / 2, every=5)
    track = walker(0, len(looks), (100, 200), speed_px=0)
    run = 1600 * time_s[looks]  # the body's height in an eighth of a second
    track.keypoints2d[..., 0] += run[:, None]
    track.bbox[:, [0, 2]] += run[:, None]
    assert cuts_in_scene(looked_at_seldom(track, looks=looks, time_s=time_s), time_s=time_s) == []
