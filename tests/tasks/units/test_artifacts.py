"""What one run has of a video: units as soon as they are defined, artifacts once they are there, also elsewhere."""

import dataclasses
from typing import Any

import pytest

from humanmm.errors import MissingInputError, StoreError
from humanmm.models.records.shots import Scenes, ShotList
from humanmm.models.records.video import VideoFacts
from humanmm.storage.store.open import open_store
from humanmm.tasks.units.artifacts import Artifacts


@pytest.fixture
def finished(toy: Any) -> Any:
    """A whole run of the toy."""
    return toy.run()


def _empty(run: Any) -> Artifacts:
    return Artifacts(run.store, run.stages)


def test_units_are_known_once_the_stage_that_defines_them_has_its_artifact(finished: Any) -> None:
    empty = _empty(finished)
    assert empty.units(empty.stage("camera")) is None and empty.units(empty.stage("points")) is None
    assert [unit.label for unit in empty.units(empty.stage("decode")) or ()] == ["decode"]
    with pytest.raises(MissingInputError, match="the units of camera are not known yet"):
        empty.unit("camera")
    assert empty.definition("shot", ShotList) is None
    assert len(finished.units(finished.stage("camera"))) == 3 and len(finished.units(finished.stage("points"))) == 2


def test_what_a_stage_depends_on_goes_through_all_stages_before_it(finished: Any) -> None:
    empty = _empty(finished)
    assert empty.upstream(empty.stage("decode")) == set()
    assert {"decode", "scenes", "people", "shots"} <= empty.upstream(empty.stage("camera"))
    assert "refine" not in empty.upstream(empty.stage("align"))


def test_an_artifact_that_is_not_there_is_named(finished: Any) -> None:
    (scenes,) = finished.units(finished.stage("scenes"))
    empty = _empty(finished)
    assert empty.manifest("scenes") is None and empty.read_once(scenes, Scenes) is None
    with pytest.raises(MissingInputError, match="the artifact of scenes is not in the store"):
        empty.read(scenes, Scenes)


def test_another_process_adopts_what_a_unit_reads_and_nothing_more(toy: Any, finished: Any) -> None:
    first = Artifacts(open_store(toy.store), finished.stages)
    first.outcomes = dict(finished.outcomes)
    unit = first.unit("camera", 1)
    references = first.references(unit)
    assert ("points", 1) in references and ("points", 0) not in references
    assert ("scenes", 0) in references and ("shots", 0) in references  # they define units
    other = Artifacts(open_store(toy.store), finished.stages)
    other.adopt(references | {("people", 1): None})
    assert other.unit("camera", 1) == unit
    listed, adopted = (artifacts.definition("shot", ShotList) for artifacts in (first, other))
    assert listed is not None and adopted is not None and [s.start for s in adopted.shots] == [0, 20, 40]
    assert (other.outcomes[("people", 1)].state, other.outcomes[("shots", 0)].state) == ("failed", "cached")
    assert not any(outcome.changed for outcome in other.outcomes.values())


def test_a_result_that_another_process_replaced_by_another_content_is_not_taken_for_that_of_the_run(
    any_toy: Any,
) -> None:
    run = any_toy.run()
    unit = run.unit("decode")
    facts, recipe, other = run.read(unit, VideoFacts), run.keys.recipe(unit), open_store(any_toy.store)
    for warnings, is_same in ((facts.warnings, True), (("another",), False)):
        with other.lock("decode", recipe.key), other.new_folder() as folder:
            value = dataclasses.replace(facts, warnings=warnings)
            other.commit(folder, value, VideoFacts, recipe, unit="video", seconds=1.0, version="0")
        if is_same:
            assert run.read(unit, VideoFacts).warnings == warnings
        else:
            with pytest.raises(StoreError, match="replaced decode by a result of another content; run again"):
                run.read(unit, VideoFacts)
    assert any_toy.open().look_up(unit) is not None, "the next run takes it"
