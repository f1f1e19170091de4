"""A finished run opened again: what would run now, what ran then, and a record that tells too little."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from humanmm.errors import InputError
from humanmm.tasks.engine.finish import write_results
from humanmm.tasks.engine.reopened import explain, reopen


@pytest.fixture
def run_dir(toy: Any) -> Path:
    """The run folder of a whole run."""
    run = toy.run()
    write_results(run, toy.folder / "run", started=0.0, log_text="")
    return Path(toy.folder / "run")


def test_a_run_is_explained_unit_by_unit(run_dir: Path) -> None:
    record, run = reopen(run_dir)
    explained = explain(record, run, "camera")
    assert [(one["unit"], one["shot"]) for one in explained] == [("shot 0", 0), ("shot 1", 1), ("shot 2", 2)]
    (second,) = explain(record, run, "camera", shot=1)
    assert second["artifact"] == explained[1]["artifact"] and second["state"] == "cached"
    assert isinstance(second["bytes"], int) and isinstance(second["recipe"], dict)
    assert second["in_this_run"] == next(one for one in record["stages"] if one["unit"] == "shot 1")


def test_a_video_that_is_gone_is_found_by_its_content(toy: Any, run_dir: Path) -> None:
    toy.video.unlink()
    _, run = reopen(run_dir)
    assert {one["state"] for one in explain(*reopen(run_dir), "camera")} == {"cached"}
    assert run.video.path == toy.video


def test_a_moved_store_is_given_and_a_record_without_its_store_is_an_error(toy: Any, run_dir: Path) -> None:
    moved = toy.folder / "moved"
    shutil.copytree(toy.store, moved)
    record, run = reopen(run_dir, moved)
    assert run.store.location != record["store"]
    del record["store"]
    (run_dir / "run.json").write_text(json.dumps(record))
    with pytest.raises(InputError, match=r"run\.json lacks 'store'; `humanmm recover` writes it anew"):
        reopen(run_dir)


def test_where_the_store_was_moved_the_users_own_is_looked_into_with_a_warning(
    toy: Any, run_dir: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    moved = toy.store.rename(toy.folder / "moved")
    monkeypatch.setenv("HUMANMM_STORE", str(moved))
    record, run = reopen(run_dir)
    assert {one["state"] for one in explain(record, run, "camera")} == {"cached"}
    assert caplog.messages[0] == f"the run's store {toy.store} is not there; {moved} is looked into in its place"
    assert not toy.store.exists()
