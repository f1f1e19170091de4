"""Keys: equal for equal code, settings and inputs, and for nothing else."""

from typing import Any

import pytest

from humanmm import config
from humanmm.errors import MissingInputError


def _key(run: Any, stage: str, index: int = 0) -> str:
    return str(run.keys.recipe(run.unit(stage, index)).key)


def test_a_setting_changes_the_keys_of_the_stages_that_name_it(toy: Any) -> None:
    plain, static = toy.run(), toy.run(camera={"static": True})
    for stage in ("decode", "people", "points", "intrinsics"):
        assert _key(plain, stage) == _key(static, stage)
    for stage in ("camera", "hmr", "align"):  # the later ones by what they read
        assert _key(plain, stage) != _key(static, stage)


def test_a_correction_of_one_shot_changes_the_key_of_that_shot(toy: Any) -> None:
    plain = toy.run()
    corrected = toy.run(corrections={"correction": [{"kind": "static-shot", "frame": 25}]})
    same = [_key(plain, "camera", shot) == _key(corrected, "camera", shot) for shot in range(3)]
    assert same == [True, False, True]
    assert "corrections" in corrected.keys.recipe(corrected.unit("camera", 1)).settings


def test_a_recipe_names_its_inputs_by_their_content(toy: Any) -> None:
    run = toy.run()
    inputs = run.keys.recipe(run.unit("camera", 1)).inputs
    assert {"shot", "points", "people", "intrinsics"} <= set(inputs) and "video" not in inputs
    assert inputs["points"] == run.manifest("points", 1).digest
    assert run.keys.recipe(run.unit("decode")).inputs == {"video": run.video.sha256}
    everything = run.keys.recipe(run.unit("align")).inputs
    assert {"camera · shot 0", "camera · shot 1", "camera · shot 2"} <= set(everything)
    run.outcomes[("camera", 1)].manifest = None
    assert run.keys.recipe(run.unit("align")).inputs["camera · shot 1"] == "failed"


def test_without_its_inputs_a_unit_has_no_key(toy: Any) -> None:
    run = toy.run()
    unit = run.unit("camera", 1)
    del run.outcomes[("points", 1)]
    with pytest.raises(MissingInputError, match="the artifact of points · scene 1 is not in the store"):
        run.keys.recipe(unit)


@pytest.mark.parametrize("alone", [True, False], ids=["a file", "a folder of one file"])
def test_what_is_brought_along_counts_by_its_content_and_the_names_of_files_wherever_it_lies(
    toy: Any, alone: bool
) -> None:
    def given(folder: str, name: str, content: bytes = b"bodies") -> str:
        path = toy.folder / folder / name
        path.parent.mkdir()
        path.write_bytes(content)
        run = toy.run(people={"hmr_from": str(path if alone else path.parent)})
        assert run.config.people.hmr_from.read() == {name: content}
        return _key(run, "people")

    first = given("a", "walk@000000.pt")
    assert first == given("b", "walk@000000.pt"), "at another place"
    assert first != given("c", "walk@000120.pt"), "of another clip"
    assert first != given("d", "walk@000000.pt", b"others")


def test_the_rate_at_which_people_are_looked_at_is_in_the_key_also_where_it_is_not_given(
    toy: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = _key(toy.run(), "people")
    assert plain == _key(toy.run(people={"max_rate_hz": 30.0}), "people")
    monkeypatch.setattr(config, "BEST_HZ", 25.0)
    assert plain != _key(toy.run(), "people")
