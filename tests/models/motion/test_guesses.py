"""How sure the floor is, and who is who."""

from dataclasses import replace

import numpy as np
import pytest
from standing_person import NUM_FRAMES, recording_of, standing_person

from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.guesses import guesses_of, identity_guesses
from humanmm.models.records.motion import PersonMotion, WorldMotion
from humanmm.models.records.recording import Guesses, IdentityGuess, Recording
from humanmm.models.records.shots import Appearance, Shot, ShotList
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.shots import identity

TIME_S = np.arange(NUM_FRAMES) / 30


def _standing(number: int, *, rise_m: float = 0.0, contact: float = 1.0) -> PersonMotion:
    """A body that stands still, its soles so high above z = 0."""
    person = standing_person(number)
    pelvis = person.pelvis + np.array([0.0, 0.0, rise_m])
    return PersonMotion(
        person=number,
        frame=person.frame,
        observed=person.observed,
        R_world_root=rotvec_to_rotmat(person.root_orient),
        body_pose=person.body_pose,
        betas=person.betas.astype(np.float64),
        pelvis_world=pelvis.astype(np.float64),
        contacts=np.full((NUM_FRAMES, 4), contact, np.float32),
        confidence=person.confidence,
    )


def _recorded(*people: PersonMotion, visibility: float = 1.0) -> Recording:
    """What was seen of these people: every landmark, so well; `standing_person` stands on the floor."""
    rise = {one.person: one.pelvis_world[0, 2] - standing_person().pelvis[0, 2] for one in people}
    found = []
    for one in people:
        person = standing_person(one.person)
        joints = person.joints + np.array([0, 0, rise[one.person]], np.float32)
        keypoints = np.full((NUM_FRAMES, 33, 3), visibility, np.float32)
        found.append(replace(person, joints=joints, keypoints2d=keypoints, contacts=one.contacts))
    return recording_of(*found)


def _guesses(*people: PersonMotion, visibility: float = 1.0) -> Guesses:
    recording = _recorded(*people, visibility=visibility)
    return guesses_of(ShotList(NUM_FRAMES, (), ()), [], _world(*people), recording, time_s=TIME_S)


def _world(*people: PersonMotion) -> WorldMotion:
    R, t, K = np.tile(np.eye(3), (NUM_FRAMES, 1, 1)), np.zeros((NUM_FRAMES, 3)), np.tile(np.eye(3), (NUM_FRAMES, 1, 1))
    return WorldMotion(R, t, K, np.zeros(NUM_FRAMES, np.uint8), people, ())


def _shots(*people: tuple[int, ...]) -> ShotList:
    """A shot for each, in one scene each, with these people in this order of tracks."""
    return ShotList(
        NUM_FRAMES,
        tuple(
            Shot(k, 10 * k, 10 * k + 10, k, None, tuple(Appearance(person, track) for track, person in enumerate(who)))
            for k, who in enumerate(people)
        ),
        (),
    )


def test_the_floor_is_as_sure_as_standing_soles_agree() -> None:
    level = _guesses(_standing(0), _standing(1))
    assert level.floor_m == pytest.approx(0.0, abs=1e-6) and level.standing_soles == 2 * 4 * NUM_FRAMES
    stairs = _guesses(_standing(0, rise_m=-0.1), _standing(1, rise_m=0.1))
    assert stairs.floor_m == pytest.approx(0.1, abs=0.01)


def test_feet_that_hang_or_stand_on_a_table_say_nothing_about_the_floor() -> None:
    assert _guesses(_standing(0, contact=0.2), _standing(1, rise_m=0.8)).standing_soles == 0
    nothing = _guesses(_standing(0, contact=0.2))
    assert np.isnan(nothing.floor_m) and nothing.standing_soles == 0


def test_feet_that_nobody_sees_say_nothing_about_the_floor() -> None:
    unseen = _guesses(_standing(0), visibility=0.1)
    assert np.isnan(unseen.floor_m) and unseen.standing_soles == 0 and unseen.off_floor == ()


@pytest.mark.parametrize(("rise_m", "told"), [(0.0, False), (0.1, False), (0.25, True), (-0.2, True), (0.8, False)])
def test_who_stands_and_not_on_the_floor_is_told(rise_m: float, told: bool) -> None:
    found = _guesses(_standing(0), _standing(1, rise_m=rise_m)).off_floor
    assert [one.person for one in found] == ([1] if told else [])
    assert all((one.start, one.end) == (0, NUM_FRAMES) for one in found)
    assert all(one.height_m == pytest.approx(rise_m, abs=0.01) for one in found)
    assert _guesses(_standing(0, contact=0.2, rise_m=rise_m)).off_floor == ()


@pytest.mark.parametrize(
    ("odds", "people", "message"),
    [
        ({(0, 0): 3.0}, ((0,), (0,)), {(0, 1): (3.0, None)}),  # against being new
        ({(0, 1): -2.0}, ((0,), (1,)), {(1, 1): (2.0, 0)}),  # new, against being person 0
        (
            {(0, 0): 3.0, (1, 1): 3.0, (0, 1): 2.5, (1, 0): 2.5},
            ((0, 1), (0, 1)),
            {(0, 1): (1.0, 1), (1, 1): (1.0, 0)},
        ),  # a swap
        ({(0, 0): 3.0, (1, 0): 2.0}, ((0, 1), (0,)), {(0, 1): (1.0, 1)}),  # person 1 is not seen: it may be he
    ],
)
def test_an_identity_is_as_sure_as_it_is_better_than_the_best_other_answer(
    monkeypatch: pytest.MonkeyPatch,
    odds: dict[tuple[int, int], float],
    people: tuple[tuple[int, ...], ...],
    message: dict[tuple[int, int], tuple[float, int | None]],
) -> None:
    """`odds`: (who was known, who is seen) → log-odds that they are the same."""
    shots = _shots(*people)
    seen = {(k, track): person for k, who in enumerate(people) for track, person in enumerate(who)}

    def view(shot_index: int, shot: Shot, track: int, *rest: object) -> tuple[int, int]:
        return shot_index, track

    monkeypatch.setattr(identity, "sighting", view)
    monkeypatch.setattr(identity, "same_person_odds", lambda known, new: odds.get((seen[known[0]], seen[new]), -9.0))
    scenes = [ScenePeople(0, NUM_FRAMES, ()) for _ in people]
    monkeypatch.setattr(ScenePeople, "track_of", lambda scene, appearance: None)
    found = identity_guesses(shots, scenes, time_s=TIME_S)
    assert found == [
        IdentityGuess(person, shot, pytest.approx(1 / (1 + np.exp(-margin))), other)
        for (person, shot), (margin, other) in message.items()
    ]


def test_a_scene_that_failed_says_nothing_of_who_is_in_it() -> None:
    shots = _shots((0,), (0,))
    assert identity_guesses(shots, [None, None], time_s=TIME_S) == []
