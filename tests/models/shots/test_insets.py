"""People in a picture within the picture."""

from dataclasses import replace

import numpy as np
import pytest
from three_shots import LENGTH, results

from humanmm.models.motion.rotations.shot_graph import cut_edge
from humanmm.models.motion.rotations.shot_results import ShotResults, witnesses_of
from humanmm.models.records.motion import CutAlignment
from humanmm.models.records.shots import Person, Scenes, ShotList, Transition
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.shots.insets import in_inset, without_insets

CORNER = (400.0, 0.0, 640.0, 140.0)
INSIDE = np.tile(np.float32([450, 20, 500, 120]), (19, 1))


def test_somebody_is_in_an_inset_whose_boxes_almost_always_lie_in_what_is_drawn() -> None:
    lower = INSIDE + np.float32([0, 60, 0, 60])
    assert in_inset(INSIDE, [CORNER])
    assert in_inset(INSIDE, [(400.0, 0.0, 480.0, 140.0), (470.0, 0.0, 640.0, 140.0)])
    assert in_inset(np.concatenate([INSIDE, lower[:1]]), [CORNER])
    assert not in_inset(np.concatenate([INSIDE, lower[:4]]), [CORNER])
    assert not in_inset(INSIDE, [])


def test_people_in_insets_are_left_out_of_their_scene_alone() -> None:
    track = replace(results().scenes[0].tracks[0], bbox=np.tile(INSIDE[:1], (LENGTH, 1)))  # type: ignore[union-attr]
    people = [ScenePeople(0, 20, (track,)), None, ScenePeople(40, 60, (track,))]
    cuts = tuple(Transition("cut", frame, frame, "scene") for frame in (20, 40))
    kept = without_insets(people, Scenes(60, cuts, burned_in=((), (CORNER,), (CORNER,))))
    assert [None if scene is None else len(scene.tracks) for scene in kept] == [1, None, 0]
    assert without_insets(people, Scenes(60, cuts)) == people


def with_people(*people: Person) -> ShotResults:
    """Three shots that show person 0, who is the first of these."""
    whole = results()
    return replace(whole, shots=ShotList(whole.shots.num_frames, whole.shots.shots, people))


@pytest.mark.parametrize(("inset", "joined"), [(False, (0,)), (True, ())])
def test_who_is_in_an_inset_joins_no_shots_even_alone(inset: bool, joined: tuple[int, ...]) -> None:
    whole = with_people(Person(0, np.zeros(10), 1.0, 0.3, inset=inset))

    def method(people: list[object], *_: object, **__: object) -> CutAlignment:
        return CutAlignment(20, "bundle", np.eye(3), 1.0, 5.0, 0.0, bool(people))

    edge = cut_edge(whole, 1, method, {})  # type: ignore[arg-type]
    assert edge.people == joined
    assert edge.cut.linked is bool(joined)


def test_cameras_are_judged_by_who_was_filmed_and_is_a_person() -> None:
    sure, doubtful = Person(0, np.zeros(10), 1.0), Person(1, np.zeros(10), 1.0, 0.4)
    inset = Person(2, np.zeros(10), 1.0, 0.3, inset=True)
    listed = ShotList(60, (), (sure, doubtful, inset))
    assert listed.witnesses([0, 1, 2]) == {0}
    assert listed.witnesses([1, 2]) == {1}
    assert listed.witnesses([2]) == {2}
    assert listed.witnesses([]) == frozenset()
    assert list(witnesses_of(with_people(inset), 0)) == [0]
