"""How sure the floor is, and who is who."""

import numpy as np
import pytest
from standing_person import NUM_FRAMES, standing_person

from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.guesses import guesses_of, identity_guesses, standing_soles
from humanmm.models.records.motion import PersonMotion, WorldMotion
from humanmm.models.records.recording import IdentityGuess
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
    nobody = ShotList(NUM_FRAMES, (), ())
    level = guesses_of(nobody, [], _world(_standing(0), _standing(1)), time_s=TIME_S)
    assert level.floor_m == pytest.approx(0.0, abs=1e-6) and level.standing_soles == 2 * 4 * NUM_FRAMES
    stairs = guesses_of(nobody, [], _world(_standing(0, rise_m=-0.1), _standing(1, rise_m=0.1)), time_s=TIME_S)
    assert stairs.floor_m == pytest.approx(0.1, abs=0.01)


def test_feet_that_hang_or_stand_on_a_table_say_nothing_about_the_floor() -> None:
    assert len(standing_soles(_world(_standing(0, contact=0.2), _standing(1, rise_m=0.8)).people)) == 0
    nothing = guesses_of(ShotList(NUM_FRAMES, (), ()), [], _world(_standing(0, contact=0.2)), time_s=TIME_S)
    assert np.isnan(nothing.floor_m) and nothing.standing_soles == 0


@pytest.mark.parametrize(
    ("odds", "people", "message"),
    [
        ({(0, 0): 3.0}, ((0,), (0,)), {(0, 1): 3.0}),  # against being new
        ({(0, 1): -2.0}, ((0,), (1,)), {(1, 1): 2.0}),  # new, against being person 0
        ({(0, 0): 3.0, (1, 1): 3.0, (0, 1): 2.5, (1, 0): 2.5}, ((0, 1), (0, 1)), {(0, 1): 1.0, (1, 1): 1.0}),  # a swap
        ({(0, 0): 3.0, (1, 0): 2.0}, ((0, 1), (0,)), {(0, 1): 1.0}),  # person 1 is not seen: it may be he
    ],
)
def test_an_identity_is_as_sure_as_it_is_better_than_the_best_other_answer(
    monkeypatch: pytest.MonkeyPatch,
    odds: dict[tuple[int, int], float],
    people: tuple[tuple[int, ...], ...],
    message: dict[tuple[int, int], float],
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
    expected = [IdentityGuess(person, shot, 1 / (1 + np.exp(-margin))) for (person, shot), margin in message.items()]
    assert [(one.person, one.shot) for one in found] == [(one.person, one.shot) for one in expected]
    for one, other in zip(found, expected, strict=True):
        assert one.probability == pytest.approx(other.probability)


def test_a_scene_that_failed_says_nothing_of_who_is_in_it() -> None:
    shots = _shots((0,), (0,))
    assert identity_guesses(shots, [None, None], time_s=TIME_S) == []
