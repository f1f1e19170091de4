"""Worlds: which shots are in one, and who and what moves with which."""

from dataclasses import replace

import numpy as np

from humanmm.models.motion.refine.worlds import JoinedShot, members_of, worlds_of
from humanmm.models.records.motion import CutAlignment, PersonMotion, WorldMotion
from humanmm.models.records.shots import Appearance, Person, Shot, ShotList

F = 30


def _shot(linked: bool, people: set[int], *earlier: int) -> JoinedShot:
    return JoinedShot(linked, earlier, frozenset(people))


def test_an_unlinked_shot_begins_a_world_and_a_linked_one_is_in_that_of_its_evidence_or_people() -> None:
    shots = [_shot(True, {0}), _shot(False, {1}), _shot(True, {0}), _shot(True, {2}, 1), _shot(False, set())]
    assert worlds_of([*shots, _shot(True, set())]) == (0, 1, 0, 1, 2, 2)


def _person(number: int, start: int, end: int) -> PersonMotion:
    n = end - start
    return PersonMotion(
        person=number, frame=np.arange(start, end, dtype=np.int32), observed=np.ones(n, bool),
        R_world_root=np.tile(np.eye(3), (n, 1, 1)), body_pose=np.zeros((n, 23, 3)), betas=np.zeros(10),
        pelvis_world=np.zeros((n, 3)), contacts=np.zeros((n, 4), np.float32), confidence=np.ones(n, np.float32),
    )  # fmt: skip


def test_cameras_move_with_the_people_of_their_world_and_those_without_people_with_their_neighbours() -> None:
    numbers = ([1], [], [0], [0])  # the second shot shows nobody, the third is of another place
    shots = tuple(
        Shot(k, 8 * k, min(8 * k + 8, F), 0, None, tuple(Appearance(person, 0, ()) for person in people))
        for k, people in enumerate(numbers)
    )
    shot_list = ShotList(F, shots, (Person(0, np.zeros(10), 1.0), Person(1, np.zeros(10), 1.0)))
    cuts = tuple(
        CutAlignment(8 * k, "none", np.eye(3), float("nan"), 180.0, float("nan"), linked=k == 3) for k in (1, 2, 3)
    )
    motion = WorldMotion(
        np.tile(np.eye(3), (F, 1, 1)), np.zeros((F, 3)), np.tile(np.eye(3), (F, 1, 1)), np.zeros(F, np.uint8),
        (_person(0, 16, F), _person(1, 0, 12)), cuts,
    )  # fmt: skip
    members = members_of(motion, shot_list)
    assert members.of_person == {0: 2, 1: 0}
    assert members.of_frame.tolist() == [0] * 12 + [2] * (F - 12)
    of_one = members_of(replace(motion, cuts=()), shot_list)
    assert set(of_one.of_frame) == set(of_one.of_person.values()) == {0}
    assert not members_of(motion, None).of_frame.any(), "without shots all is one world"
