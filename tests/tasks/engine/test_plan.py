"""What a dry run says is never wrong, and it writes nothing."""

from pathlib import Path
from typing import Any

import pytest

from humanmm.errors import InputError, MissingInputError
from humanmm.storage.store.bucket import Bucket
from humanmm.tasks.engine.plan import Forecast, check_upstream, forecast, is_complete
from humanmm.tasks.units.selection import Selection


def _plan(toy: Any, selection: Selection | None = None, **settings: Any) -> list[Forecast]:
    before = sorted(toy.store.rglob("*"))
    plan = forecast(toy.open(selection=selection, read_only=True, **settings))
    assert sorted(toy.store.rglob("*")) == before, "a dry run writes nothing"
    return plan


def _named(plan: list[Forecast], state: str) -> set[str]:
    chosen = [entry for entry in plan if entry.state == state]
    return {entry.stage if entry.shot is None else f"{entry.stage}:{entry.shot}" for entry in chosen}


def test_on_a_cold_store_only_the_first_stage_is_certain(toy: Any) -> None:
    plan = _plan(toy)
    assert _named(plan, "will run") == {"decode"}
    assert _named(plan, "cached") == set()
    assert {entry.sentence for entry in plan if entry.stage == "camera"} == {"depends on shots's result"}
    assert not toy.store.exists()


def test_on_a_warm_store_everything_is_cached(toy: Any) -> None:
    toy.run()
    assert is_complete(_plan(toy))


@pytest.mark.parametrize(
    ("settings", "selection"),
    [
        ({}, None),
        ({"camera": {"static": True}}, None),
        ({"people": {"max_people": 3}}, None),
        ({"decode": {"max_side_px": 640}}, None),
        ({}, Selection(start="hmr")),
        ({}, Selection(start="camera", shot=1)),
        ({}, Selection(force=True)),
    ],
)
def test_what_is_called_cached_is_not_run_and_what_is_said_to_run_is_run(
    toy: Any, settings: dict[str, Any], selection: Selection | None
) -> None:
    toy.run()
    toy.executed()
    plan = _plan(toy, selection, **settings)
    run = toy.run(selection=selection, **settings)
    computed = {
        name if run.stage(name).per != "shot" else f"{name}:{index}"
        for (name, index), outcome in run.outcomes.items()
        if outcome.state == "computed"
    }
    assert _named(plan, "will run") <= computed
    assert not _named(plan, "cached") & computed
    unknown = {f"{e.stage}:{shot}" for e in plan if e.unit == "every shot" for shot in range(3)}
    assert computed <= _named(plan, "will run") | _named(plan, "depends") | unknown


def test_a_dry_run_on_a_bucket_writes_nothing_there_and_is_right(toy: Any, bucket: str) -> None:
    toy.store = Path(bucket)
    toy.run()
    toy.executed()
    folders = ("artifacts", "latest", "damaged", "locks", "batches")
    before = [found for folder in folders for found in Bucket(bucket).list(folder)]
    plan = forecast(toy.open(read_only=True, camera={"static": True}))
    assert [found for folder in folders for found in Bucket(bucket).list(folder)] == before
    run = toy.run(camera={"static": True})
    computed = {name for (name, _), outcome in run.outcomes.items() if outcome.state == "computed"}
    assert {entry.stage for entry in plan if entry.state != "cached"} == computed


def test_damage_is_foretold(toy: Any) -> None:
    run = toy.run()
    (toy.store / run.manifest("camera", 1).ref.uri / "result.json").write_text("{}")
    plan = _plan(toy)
    (entry,) = [entry for entry in plan if entry.state == "will run"]
    assert (entry.stage, entry.shot) == ("camera", 1)
    assert "damaged artifact: result.json" in entry.reason


def test_force_from_one_shot_names_that_shot_alone(toy: Any) -> None:
    toy.run()
    plan = _plan(toy, Selection(start="camera", shot=1))
    assert _named(plan, "will run") == {"camera:1"}
    assert {"hmr:0", "camera:0", "camera:2", "points"} <= _named(plan, "cached")
    assert {"hmr:1", "align"} <= _named(plan, "depends")


def test_only_needs_everything_before_it(toy: Any) -> None:
    toy.run()
    selection = Selection(only="align")
    check_upstream(toy.open(selection=selection), _plan(toy, selection), "align")
    run = toy.open()
    forecast(run)
    (toy.store / run.manifest("hmr", 2).ref.uri / "COMMIT").unlink()
    with pytest.raises(MissingInputError, match=r"needs the artifact of hmr \(shot 2\)"):
        check_upstream(run, _plan(toy, selection), "align")


def test_only_foretells_nothing_of_stages_that_run_only_if_its_output_changes(toy: Any) -> None:
    toy.run()
    plan = _plan(toy, Selection(only="camera"))
    assert _named(plan, "will run") == {"camera:0", "camera:1", "camera:2"}
    assert {"hmr:0", "align", "deliver"} <= _named(plan, "depends")


def test_a_shot_that_does_not_exist_is_refused(toy: Any) -> None:
    toy.run()
    with pytest.raises(InputError, match="the video has 3 shots, 0 to 2"):
        _plan(toy, Selection(start="camera", shot=3))


@pytest.mark.parametrize(
    ("selection", "message"),
    [
        (Selection(start="nothing"), "there is no stage 'nothing'"),
        (Selection(start="hmr", force=True), "choose one"),
        (Selection(shot=1), "--shot needs"),
        (Selection(only="hmr", shot=-1), "negative"),
    ],
)
def test_selections_that_make_no_sense_are_refused(toy: Any, selection: Selection, message: str) -> None:
    with pytest.raises(InputError, match=message):
        selection.check(toy.open().stages)


def test_stages_that_ignore_the_shot_are_named(toy: Any) -> None:
    assert Selection(start="hmr", shot=0).check(toy.open().stages) == [
        "--shot 0 is ignored by align, refine, deliver: not computed per shot"
    ]
