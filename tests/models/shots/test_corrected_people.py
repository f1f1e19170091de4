"""What the user says of people, on tracks that are put together wrongly."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from humanmm.corrections import (
    Correction,
    Corrections,
    Exclude,
    Height,
    Main,
    Nobody,
    SamePerson,
    Sides,
    Swap,
    Who,
)
from humanmm.models.body.body24 import load_body
from humanmm.models.perception.clothing import HISTOGRAM_BINS
from humanmm.models.records.landmarks import NUM_LANDMARKS
from humanmm.models.records.shots import CorrectionNote, Scenes, Shot, ShotList, TrackPart, Transition
from humanmm.models.records.tracks import PersonTrack, ScenePeople, Silhouettes
from humanmm.models.records.video import VideoFacts
from humanmm.models.shots.assemble import detect_shots
from humanmm.models.shots.corrected_people import corrected_people
from humanmm.models.shots.identity import cast_of, matched_people

FACTS = VideoFacts(960, 540, np.arange(60) / 30, np.arange(60) == 0, 0, "h264", "mp4")
SCENES = Scenes(60, (Transition("cut", 30, 30, "scene"),))
RED, BLUE, GREEN = (np.eye(HISTOGRAM_BINS)[k] for k in (3, 17, 30))


def track(first: int, last: int, colours: np.ndarray, *, x: float, size: float = 100.0) -> PersonTrack:
    """Somebody who stands at x for some frames."""
    count = last - first
    rng = np.random.default_rng(5)
    pose = rng.normal(0, 0.3, (NUM_LANDMARKS, 3))
    pixels = np.concatenate([pose[:, :2] * size + (x, 250.0), np.ones((NUM_LANDMARKS, 1))], axis=1)
    box = np.array([x - size / 4, 250 - size / 2, x + size / 4, 250 + size / 2])
    return PersonTrack(
        frame=np.arange(first, last, dtype=np.int32),
        keypoints2d=np.repeat(pixels[None], count, axis=0).astype(np.float32),
        landmarks3d=np.repeat(pose[None], count, axis=0).astype(np.float32),
        bbox=np.repeat(box[None], count, axis=0).astype(np.float32),
        confidence=np.full(count, 0.9, np.float32),
        masks=Silhouettes.pack(np.zeros((count, 128, 128))),
        mask_affine=np.zeros((count, 2, 3), np.float32),
        color_frame=np.arange(first, last, 5).astype(np.int32),
        color_histogram=np.repeat(colours[None], len(range(first, last, 5)), axis=0).astype(np.float32),
        probability=0.9,
    )


PEOPLE = (
    ScenePeople(
        0, 30, (track(0, 30, RED, x=200, size=160), track(0, 30, BLUE, x=600), track(0, 30, GREEN, x=850, size=60))
    ),
    ScenePeople(30, 60, (track(30, 60, BLUE, x=300), track(30, 60, RED, x=700, size=160))),
)  # fmt: skip
"""Red is person 0, blue person 1, green, in the first shot alone, person 2."""


def at(frame: int, x: float) -> Who:
    return Who(frame=frame, x=x, y=250)


RED_1, BLUE_1, GREEN_1, BLUE_2, RED_2 = at(10, 200), at(10, 600), at(10, 850), at(40, 300), at(40, 700)


def corrected(
    *corrections: Correction, scenes: Sequence[ScenePeople] = PEOPLE
) -> tuple[ShotList, tuple[CorrectionNote, ...]]:
    """The shots with the people in them, without the detector's errors, and what became of the corrections."""
    cut = SCENES.transitions[0]
    shots = [Shot(0, 0, 30, 0, None, (), cut), Shot(1, 30, 60, 1, cut, ())]
    groups = matched_people(shots, scenes, time_s=FACTS.time_s)
    asked = Corrections(correction=corrections)
    people, notes = corrected_people(groups, shots, scenes, asked, time_s=FACTS.time_s)
    cast = cast_of(people, len(shots))
    inhabited = tuple(replace(shot, people=own) for shot, own in zip(shots, cast.appearances, strict=True))
    return ShotList(60, inhabited, cast.people), tuple(notes)


def seen(listed: ShotList, number: int, shot: int) -> tuple[list[int], list[float]]:
    """The frames in which a person is seen in a shot, and where."""
    one: Shot = listed.shots[shot]
    own = next(appearance for appearance in one.people if appearance.person == number)
    track = PEOPLE[one.scene].track_of(own)
    inside = (track.frame >= one.start) & (track.frame < one.end)
    return track.frame[inside].tolist(), sorted({float(x) for x in track.bbox[inside][:, [0, 2]].mean(axis=1)})


def people_of(listed: ShotList) -> list[list[int]]:
    return [[appearance.person for appearance in sorted(shot.people, key=lambda a: a.person)] for shot in listed.shots]


def test_without_corrections_there_are_three_people() -> None:
    listed, notes = corrected()
    assert people_of(listed) == [[0, 1, 2], [0, 1]] and notes == ()


def test_two_people_are_one_across_a_cut_or_in_one_shot() -> None:
    listed, (note,) = corrected(SamePerson(who=GREEN_1, other=BLUE_2))
    assert note.applied and "both are seen in 30 frames" in note.reason, "blue was in the first shot already"
    assert people_of(listed) == [[0, 1], [0, 1]]
    assert seen(listed, 1, 0) == (list(range(30)), [850.0]), "the first of the two counts"


def test_parts_of_one_person_s_track_in_one_shot_become_one() -> None:
    begins, ends = track(0, 12, GREEN, x=400), track(15, 30, BLUE, x=430)
    people = (ScenePeople(0, 30, (begins, ends)), ScenePeople(30, 60, ()))
    same = SamePerson(who=at(5, 400), other=at(20, 430))
    listed, (note,) = corrected(same, scenes=people)
    assert note == CorrectionNote(same.identity, True)
    (own,) = listed.shots[0].people
    np.testing.assert_array_equal(people[0].track_of(own).frame, [*range(12), *range(15, 30)])


def test_who_is_nobody_is_gone_and_the_others_are_numbered_anew() -> None:
    listed, (note,) = corrected(Nobody(who=RED_1))
    assert note.applied and people_of(listed) == [[0, 1], [0]]
    assert seen(listed, 0, 0)[1] == [600.0]


def test_two_people_change_places_in_some_frames_of_both_shots() -> None:
    listed, (note,) = corrected(Swap(who=RED_1, other=BLUE_1, start=20, end=60))
    assert note.applied
    (first,) = {own.person for own in listed.shots[0].people if own.parts and own.parts[0] == TrackPart(0, 0, 20)}
    assert seen(listed, first, 0) == (list(range(30)), [200.0, 600.0])
    assert seen(listed, first, 1) == (list(range(30, 60)), [300.0])


def test_swapping_twice_is_as_if_nothing_was_swapped() -> None:
    whole = {"who": RED_1, "other": BLUE_1, "end": 60}
    listed, _ = corrected(Swap(**whole, start=0), Swap(**whole, start=0))
    plain, _ = corrected()
    assert [shot.people for shot in listed.shots] == [shot.people for shot in plain.shots]


def test_excluded_frames_are_not_seen_of_one_or_of_anybody() -> None:
    listed, _ = corrected(Exclude(start=10, end=35, who=RED_1))
    assert seen(listed, 0, 0)[0] == [*range(10)] and seen(listed, 0, 1)[0] == [*range(35, 60)]
    assert seen(listed, 1, 0)[0] == [*range(30)]
    listed, _ = corrected(Exclude(start=25, end=35))
    assert all(seen(listed, number, 0)[0] == [*range(25)] for number in (0, 1, 2))
    assert all(seen(listed, number, 1)[0] == [*range(35, 60)] for number in (0, 1))


def test_what_is_excluded_stays_so_when_two_become_one() -> None:
    listed, _ = corrected(Exclude(start=10, end=20, who=GREEN_1), SamePerson(who=GREEN_1, other=BLUE_2))
    assert seen(listed, 1, 0)[0] == [*range(30)] and seen(listed, 1, 0)[1] == [600.0, 850.0]


def test_the_main_person_is_number_zero_and_a_person_for_sure() -> None:
    doubtful = replace(PEOPLE[0].tracks[2], probability=0.25)
    people = (replace(PEOPLE[0], tracks=(*PEOPLE[0].tracks[:2], doubtful)), PEOPLE[1])
    listed, _ = corrected(Main(who=GREEN_1), scenes=people)
    assert [appearance.track for appearance in listed.shots[0].people if appearance.person == 0] == [2]
    assert listed.people[0].probability == 1.0


def test_a_height_is_that_of_the_person_and_of_nobody_else() -> None:
    plain, _ = corrected()
    listed, (note,) = corrected(Height(who=BLUE_2, metres=1.93))
    assert note.applied
    assert load_body().standing_height(listed.people[1].betas) == pytest.approx(1.93, abs=0.001)
    np.testing.assert_array_equal(listed.people[0].betas, plain.people[0].betas)
    assert [person.height_known for person in listed.people[:2]] == [False, True]


def test_sides_that_the_user_says_are_wrong_are_the_other_way_round() -> None:
    def swapped(*corrections: Correction) -> bool:
        listed = detect_shots(FACTS, Scenes(60, ()), [PEOPLE[0]], corrections=Corrections(correction=corrections))
        (own,) = (appearance for appearance in listed.shots[0].people if appearance.person == 0)
        assert own.left_right_swapped in ((), ((0, 30),)) and all(note.applied for note in listed.corrections)
        return bool(own.left_right_swapped)

    assert swapped(Sides(who=RED_1, start=0, end=30)) != swapped()


@pytest.mark.parametrize(
    ("correction", "reason"),
    [
        (Nobody(who=at(10, 400)), "nobody is seen at 400, 250 in frame 10"),
        (Nobody(who=at(99, 200)), "frame 99 does not exist: the video ends with frame 59"),
        (Height(who=Who(frame=10, x=200, y=500), metres=1.8), "nobody is seen at 200, 500 in frame 10"),
        (Swap(who=RED_1, other=RED_2, start=0, end=9), "both places show the same person"),
        (Swap(who=GREEN_1, other=at(40, 500), start=0, end=9), "nobody is seen at 500, 250 in frame 40"),
        (Sides(who=GREEN_1, start=40, end=50), "he is not seen in frames 40 to 49"),
        (Exclude(start=70, end=80), "frame 70 does not exist: the video ends with frame 59"),
    ],
)
def test_a_correction_that_does_not_fit_says_why_and_changes_nothing(correction: Correction, reason: str) -> None:
    listed, (note,) = corrected(correction)
    assert (note.applied, note.reason) == (False, reason)
    plain, _ = corrected()
    assert people_of(listed) == people_of(plain)
    assert [shot.people for shot in listed.shots] == [shot.people for shot in plain.shots]


def test_corrections_apply_in_their_order() -> None:
    """Blue is nobody, and then there is nobody whom he could be one with."""
    _, notes = corrected(Nobody(who=BLUE_1), SamePerson(who=GREEN_1, other=BLUE_2))
    assert [note.applied for note in notes] == [True, False]
    _, notes = corrected(SamePerson(who=GREEN_1, other=BLUE_2), Nobody(who=BLUE_2))
    assert [note.applied for note in notes] == [True, True]
