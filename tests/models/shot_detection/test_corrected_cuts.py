"""Cuts that the user adds and removes."""

from dataclasses import replace

from humanmm.corrections import AddCut, Corrections, RemoveCut
from humanmm.models.records.shots import Scenes, Transition
from humanmm.models.shot_detection.corrected_cuts import corrected_scenes

CUTS = Transition("cut", 50, 50, "scene"), Transition("cut", 150, 150, "scene")
FOUND = Scenes(200, (CUTS[0], Transition("dissolve", 90, 100, "scene"), CUTS[1]))


def _starts(*corrections: AddCut | RemoveCut) -> tuple[list[int], list[bool]]:
    scenes = corrected_scenes(FOUND, Corrections(correction=corrections))
    return [start for start, _ in scenes.spans], [note.applied for note in scenes.corrections]


def test_a_cut_is_added_and_one_is_removed() -> None:
    assert _starts(AddCut(frame=120), RemoveCut(frame=50)) == ([0, 95, 120, 150], [True, True])


def test_a_gradual_transition_goes_by_any_of_its_frames() -> None:
    assert _starts(RemoveCut(frame=97)) == ([0, 50, 150], [True])


def test_an_added_cut_takes_the_place_of_what_was_found_beside_or_around_it() -> None:
    assert _starts(AddCut(frame=151)) == ([0, 50, 95, 151], [True])
    assert _starts(AddCut(frame=93)) == ([0, 50, 93, 150], [True])
    scenes = corrected_scenes(FOUND, Corrections(correction=(AddCut(frame=100, end=110),)))
    assert scenes.transitions[1] == Transition("dissolve", 100, 110, "user")


def test_a_cut_that_is_found_anyway_is_no_misfit() -> None:
    scenes = corrected_scenes(FOUND, Corrections(correction=(AddCut(frame=50),)))
    assert scenes.transitions == FOUND.transitions
    assert scenes.corrections[0].applied and "without the correction" in scenes.corrections[0].reason


def test_a_cut_that_is_not_there_or_beyond_the_end_does_not_fit() -> None:
    scenes = corrected_scenes(FOUND, Corrections(correction=(RemoveCut(frame=75), AddCut(frame=200))))
    assert scenes.transitions == FOUND.transitions
    assert not any(note.applied for note in scenes.corrections)
    first, second = (note.reason for note in scenes.corrections)
    assert first == "no cut is found there; the nearest is at frame 95"
    assert second == "the video ends with frame 199"


def test_what_the_user_says_of_a_suspected_cut_settles_it() -> None:
    doubtful = replace(FOUND, suspected=(20, 120, 180))
    settled = corrected_scenes(doubtful, Corrections(correction=(RemoveCut(frame=121), AddCut(frame=180))))
    assert settled.suspected == (20,)
    assert [note.applied for note in settled.corrections] == [True, True]
    assert [start for start, _ in settled.spans] == [0, 50, 95, 150, 180]
