"""Worlds: which shots are in one, where each stands in a picture, and to which a person belongs."""

import dataclasses

import numpy as np
import two_people

from humanmm.models.motion.worlds import (
    JoinedShot,
    world_of_each_frame,
    world_of_person,
    world_places,
    worlds_of,
)

RECORDING = two_people.recording()
APART = dataclasses.replace(RECORDING, worlds=(0, 1))


def _shot(linked: bool, people: set[int], *earlier: int) -> JoinedShot:
    return JoinedShot(linked, earlier, frozenset(people))


def test_an_unlinked_shot_begins_a_world_and_a_linked_one_is_in_that_of_its_evidence_or_people() -> None:
    shots = [_shot(True, {0}), _shot(False, {1}), _shot(True, {0}), _shot(True, {2}, 1), _shot(False, set())]
    assert worlds_of([*shots, _shot(True, set())]) == (0, 1, 0, 1, 2, 2)


def test_a_recording_that_names_no_worlds_is_of_one() -> None:
    assert not world_of_each_frame(RECORDING).any()
    assert [world_of_person(RECORDING, person) for person in RECORDING.people] == [0, 0]


def test_a_person_belongs_to_the_world_in_which_he_is_observed_most() -> None:
    assert world_of_each_frame(APART).tolist() == [0] * two_people.CUT + [1] * (40 - two_people.CUT)
    unseen = APART.people[0].observed.copy()
    unseen[: two_people.CUT] = False
    later = dataclasses.replace(APART.people[0], observed=unseen)
    assert (world_of_person(APART, APART.people[0]), world_of_person(APART, later)) == (0, 1)


def test_worlds_stand_beside_each_other_in_a_picture() -> None:
    first, second = world_places(APART, APART.worlds)
    assert (first.offset_m, first.title, second.title) == (0.0, "shot 0", "shot 1")
    right_of_first = max(person.pelvis[person.frame < two_people.CUT, 0].max() for person in APART.people)
    left_of_second = min(person.pelvis[person.frame >= two_people.CUT, 0].min() for person in APART.people)
    assert second.offset_m + left_of_second > right_of_first + 2.9
    assert np.isfinite(second.center).all()
