"""Worlds of a recording: where each stands in a picture, and to which a person belongs."""

import dataclasses

import numpy as np
import two_people

from humanmm.models.motion.worlds import world_of_each_frame, world_of_person, world_places

RECORDING = two_people.recording()
APART = dataclasses.replace(RECORDING, worlds=(0, 1))


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
