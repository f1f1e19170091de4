"""Shots know where they begin, where they end, and which of their frames show them alone."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.corrections import Corrections, RemoveCut
from humanmm.errors import NoUsablePersonError
from humanmm.models.perception.clothing import HISTOGRAM_BINS
from humanmm.models.records.landmarks import HIPS, SHOULDERS
from humanmm.models.records.shots import CorrectionNote, Scenes, Shot, Transition, Unfollowed
from humanmm.models.records.tracks import PersonTrack, ScenePeople, Silhouettes
from humanmm.models.records.video import VideoFacts
from humanmm.models.shot_detection.corrected_cuts import corrected_scenes
from humanmm.models.shot_detection.people_cuts import Split
from humanmm.models.shots.assemble import _corrected, detect_shots

SCENES = Scenes(60, (Transition("cut", 30, 30, "scene"),))
FACTS = VideoFacts(960, 540, np.arange(60) / 30, np.arange(60) == 0, 0, "h264", "mp4")


@pytest.mark.parametrize("people", [[None, None], [ScenePeople(0, 30, ()), ScenePeople(30, 60, ())]])
def test_a_video_in_which_nobody_is_seen_is_an_error_in_plain_words(people: list[ScenePeople | None]) -> None:
    with pytest.raises(NoUsablePersonError, match="no usable person"):
        detect_shots(FACTS, SCENES, people)


def test_a_video_that_is_too_short_for_anybody_is_told_so_and_how_much_is_needed() -> None:
    six = replace(FACTS, time_s=np.arange(6) / 24, keyframe=np.arange(6) == 0)
    with pytest.raises(NoUsablePersonError, match=r"too short, 6 frames in 0.25 s; somebody must be seen for 0.3 s"):
        detect_shots(six, Scenes(6, ()), [ScenePeople(0, 6, ())])
    eight = replace(FACTS, time_s=np.arange(8) / 24, keyframe=np.arange(8) == 0)
    with pytest.raises(NoUsablePersonError, match="nobody is seen for long enough"):
        detect_shots(eight, Scenes(8, ()), [ScenePeople(0, 8, ())])


def somebody() -> PersonTrack:
    rng = np.random.default_rng(0)
    keypoints = rng.uniform(100, 300, (33, 3))
    keypoints[list(SHOULDERS), :2], keypoints[list(HIPS), :2] = (200, 130), (200, 230)  # upright
    return PersonTrack(
        frame=np.arange(30, dtype=np.int32),
        keypoints2d=np.tile(keypoints, (30, 1, 1)).astype(np.float32),
        landmarks3d=np.tile(rng.normal(size=(33, 3)), (30, 1, 1)).astype(np.float32),
        bbox=np.tile(np.float32([100, 100, 300, 300]), (30, 1)),
        confidence=np.full(30, 0.9, np.float32),
        masks=Silhouettes.pack(np.zeros((30, 128, 128))),
        mask_affine=np.zeros((30, 2, 3), np.float32),
        color_frame=np.zeros(1, np.int32),
        color_histogram=np.full((1, HISTOGRAM_BINS), 1 / HISTOGRAM_BINS, np.float32),
        probability=0.1,
    )


def test_if_all_are_hardly_people_the_error_says_which_setting_admits_the_likeliest() -> None:
    people = [ScenePeople(0, 30, (somebody(),)), ScenePeople(30, 60, ())]
    with pytest.raises(
        NoUsablePersonError, match=r"likeliest of 1 .* 0.10, less than 0.2; --min-confidence 0.09 admits"
    ):
        detect_shots(FACTS, SCENES, people)
    listed = detect_shots(FACTS, SCENES, people, min_confidence=0.09)
    assert listed.people[0].doubtful and listed.left_out == ()
    assert listed.warnings == ("person 0 may be no person: the probability is 0.10",)


def test_who_is_seen_in_a_picture_within_the_picture_is_somebody_else_and_doubtful() -> None:
    seen = replace(somebody(), probability=0.95)
    inset = replace(seen, bbox=np.tile(np.float32([700, 20, 750, 120]), (30, 1)))
    people = [ScenePeople(0, 30, (seen, inset)), ScenePeople(30, 60, (later(inset),))]
    listed = detect_shots(FACTS, replace(SCENES, burned_in=(((680.0, 0.0, 960.0, 140.0),),) * 2), people)
    assert [(one.inset, one.probability) for one in listed.people] == [
        (False, pytest.approx(0.95)), (True, pytest.approx(0.3)),
    ]  # fmt: skip
    assert [[(one.person, one.track) for one in shot.people] for shot in listed.shots] == [[(0, 0), (1, 1)], [(1, 0)]]
    assert [warning for warning in listed.warnings if "person 1 is seen in a picture within the picture" in warning]
    filmed = detect_shots(FACTS, SCENES, people)
    assert [one.inset for one in filmed.people] == [False, False] and not filmed.warnings


def test_who_is_left_out_is_recorded_with_his_probability_and_shots() -> None:
    likely = replace(somebody(), probability=0.9, bbox=np.tile(np.float32([600, 100, 800, 300]), (30, 1)))
    people = [ScenePeople(0, 30, ()), ScenePeople(30, 60, (later(likely), later(somebody())))]
    listed = detect_shots(FACTS, SCENES, people)
    assert len(listed.people) == 1 and not listed.warnings
    (out,) = listed.left_out
    assert out.probability == pytest.approx(0.1) and out.shots == (1,)


@pytest.mark.parametrize(("frames", "probability", "said"), [(8, 0.9, True), (9, 0.9, False), (8, 0.1, False)])
def test_who_is_left_out_because_he_is_seen_for_a_moment_has_a_warning(
    frames: int, probability: float, said: bool
) -> None:
    likely = replace(somebody(), probability=0.9)
    other = np.zeros(HISTOGRAM_BINS, np.float32)
    other[3] = 1  # dressed otherwise
    brief = later(replace(somebody(), probability=probability, color_histogram=other[None]))
    brief = replace(
        brief, **{name: getattr(brief, name)[:frames] for name in ("frame", "keypoints2d", "landmarks3d", "bbox",
                                                                   "confidence", "mask_affine")},
    )  # fmt: skip
    listed = detect_shots(FACTS, SCENES, [ScenePeople(0, 30, (likely,)), ScenePeople(30, 60, (brief,))])
    expected = "somebody is seen for 0.27 s only (shots 1) and is left out: 0.3 s and 2 frames are needed"
    assert list(listed.warnings) == ([expected] if said else [])


def test_who_is_seen_and_not_followed_is_a_warning_with_his_place() -> None:
    likely = replace(somebody(), probability=0.9)
    boy = Unfollowed(3, 27, (0.0, 54.0, 480.0, 545.0), 0.4)
    crowd = tuple(Unfollowed(30, 59, (96.0 * k, 0.0, 96.0 * k + 96, 54.0), 0.9 - 0.1 * k, True) for k in range(5))
    people = [ScenePeople(0, 30, (likely,), unfollowed=(boy,)), ScenePeople(30, 60, (), unfollowed=crowd)]
    assert detect_shots(FACTS, SCENES, people).warnings == (
        "somebody is seen who is not recovered: in frames 3-27 at 0.00 0.10 0.50 1.00 of the picture",
        "more people than --people.max-people are seen: in frames 30-59 at 0.00 0.00 0.10 0.10, in frames 30-59 at "
        "0.10 0.00 0.20 0.10, in frames 30-59 at 0.20 0.00 0.30 0.10 of the picture (and 2 more)",
    )


def test_a_picture_that_lies_on_its_side_has_a_warning() -> None:
    likely = replace(somebody(), probability=0.9)
    lying = replace(likely, keypoints2d=likely.keypoints2d[..., [1, 0, 2]])
    found = [
        detect_shots(FACTS, SCENES, [ScenePeople(0, 30, (one,)), ScenePeople(30, 60, ())]) for one in (likely, lying)
    ]
    assert [len(one.warnings) for one in found] == [0, 1] and "transpose=1" in found[1].warnings[0]


def test_a_suspected_cut_is_a_warning_unless_a_shot_begins_there() -> None:
    likely = replace(somebody(), probability=0.9)
    people = [ScenePeople(0, 30, (likely,)), ScenePeople(30, 60, ())]
    found = detect_shots(FACTS, replace(SCENES, suspected=(12, 31)), people)
    (warning,) = found.warnings
    assert "frame 12 may be a jump cut" in warning and "add-cut 12" in warning
    assert found.suspected == (12,)


def later(track: PersonTrack) -> PersonTrack:
    """The same in the second scene."""
    return replace(track, frame=track.frame + 30, color_frame=track.color_frame + 30)


@pytest.mark.parametrize(
    ("confidence", "lifted", "warned"), [(0.3, False, True), (0.6, False, False), (0.3, True, False)]
)
def test_of_whom_much_is_never_in_view_a_warning_says_that_the_rest_is_guessed(
    confidence: float, lifted: bool, warned: bool
) -> None:
    whole = somebody()
    one = replace(whole, confidence=np.full(30, confidence, np.float32), probability=0.9, lifted=lifted)
    people = [ScenePeople(0, 30, (one,)), ScenePeople(30, 60, ())]
    said = "person 0 is seen in part (confidence 0.30): what is out of view or covered is a guess"
    assert detect_shots(FACTS, SCENES, people).warnings == ((said,) if warned else ())


def test_frames_that_a_dissolve_mixes_are_outside_transitions_in_neither_shot() -> None:
    dissolve = Transition("dissolve", 25, 36, "scene")
    first = Shot(0, 0, 30, 0, None, (), ending=dissolve)
    second = Shot(1, 30, 60, 1, dissolve, (), ending=Transition("cut", 60, 60, "scene"))
    assert first.outside_transitions == (0, 25)
    assert second.outside_transitions == (36, 60)
    assert (first.clear, second.clear) == ((0, 28), (33, 60))  # the other picture has a quarter of the light at 27, 33


def test_a_shot_between_two_long_dissolves_may_have_no_frame_outside_transitions() -> None:
    shot = Shot(1, 30, 40, 1, Transition("dissolve", 22, 38, "scene"), (), Transition("fade", 36, 44, "scene"))
    assert shot.outside_transitions == (38, 38)
    assert shot.clear == (33, 36)


def test_of_a_fade_the_frames_with_half_their_light_are_evidence() -> None:
    fade = Transition("fade", 20, 34, "scene", dim=(23, 32))  # ever darker from 20, black from 26 to 29
    first = Shot(0, 0, 27, 0, None, (), fade)
    second = Shot(1, 27, 60, 1, fade, ())
    assert (first.outside_transitions, second.outside_transitions) == ((0, 20), (34, 60))
    assert (first.clear, second.clear) == ((0, 23), (32, 60))


def test_a_cut_that_people_show_and_the_user_removes_is_gone_and_one_that_nobody_shows_does_not_fit() -> None:
    colours = Transition("cut", 30, 30, "scene")
    people = Transition("cut", 45, 45, "bbox")
    one_scene = corrected_scenes(Scenes(60, (colours,)), gone := Corrections(correction=(RemoveCut(frame=30),)))
    again = Transition("cut", 30, 30, "bbox")  # once the colours' cut is removed, people show it all the same
    assert _corrected(one_scene, Split((again, people), ()), gone) == (
        Split((people,), ()),
        [CorrectionNote(gone.correction[0].identity, True)],
    )
    misfit = Corrections(correction=(RemoveCut(frame=50), RemoveCut(frame=44)))
    scenes = corrected_scenes(Scenes(60, (colours,)), misfit)
    kept, notes = _corrected(scenes, Split((colours, people), ()), misfit)
    assert kept.transitions == (colours,)
    assert [(note.applied, note.reason) for note in notes] == [
        (True, ""),
        (False, "no cut is found there; the nearest is at frame 45"),
    ]


def test_what_the_user_says_of_a_cut_that_people_make_suspect_settles_it() -> None:
    said = Corrections(correction=(RemoveCut(frame=45),))
    scenes = corrected_scenes(Scenes(60, ()), said)
    kept, (note,) = _corrected(scenes, Split((), (20, 46)), said)
    assert kept == Split((), (20,)) and (note.applied, note.reason) == (True, "")
