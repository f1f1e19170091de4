"""`humanmm.recover` and `humanmm.forecast` with toy stages: what they return, raise, write and leave alone."""

import asyncio
import contextlib
import logging
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr
from prefect.exceptions import ObjectNotFound

import humanmm
from humanmm.config_reading import validate
from humanmm.errors import InputError, ResourceError, StageError, UsageError

NUM_UNITS = 18
"""Stages × units of the toy's film."""


@pytest.fixture
def here(toy: Any, server_cache: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The toy, in its folder and with its store."""
    monkeypatch.chdir(toy.folder)
    monkeypatch.setenv("HUMANMM_STORE", str(toy.store))
    return toy


def test_importing_humanmm_loads_no_library_and_every_public_name_exists() -> None:
    script = (
        "import sys, humanmm\n"
        "heavy = {'numpy', 'torch', 'prefect', 'pydantic', 'rich', 'asyncio'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)\n"
        "assert set(humanmm.__all__) <= set(dir(humanmm))\n"
        "for name in humanmm.__all__:\n"
        "    getattr(humanmm, name)\n"
        "assert not {'numpy', 'torch', 'prefect'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True)
    with pytest.raises(AttributeError, match="no attribute 'recovr'"):
        _ = humanmm.recovr


def test_a_run_has_the_arrays_of_its_folder_and_a_second_call_finds_it_unchanged(here: Any) -> None:
    run = humanmm.recover("film.mp4", progress=False)
    assert (run.folder, run.origin, run.state) == (Path("runs/film"), "computed", "done")
    group = zarr.open_group(run.folder / "motion.zarr", mode="r")
    assert np.array_equal(run.people[0].joints, group["people/00/joints"][:])  # type: ignore[index]
    assert np.array_equal(run.cameras.R_world_cam, group["cameras/R_world_cam"][:])  # type: ignore[index]
    assert np.array_equal(run.cameras.source, group["cameras/source"][:])  # type: ignore[index]
    assert [(shot.start, shot.end) for shot in run.shots] == [(0, 20), (20, 40), (40, 60)]
    assert run.shots[0].transition is None and run.shots[1].transition == run.record["shots"][1]["transition"]
    assert "decode: a toy" in run.warnings and run.failures == ()
    assert run.video == here.video and run.config == humanmm.Config()
    assert len(here.executed()) == NUM_UNITS
    assert humanmm.recover(here.video).origin == "unchanged"
    (run.folder / "view" / "overlay.mp4").unlink()
    assert humanmm.recover(str(here.video)).origin == "restored"
    assert here.executed() == []


def test_a_failed_shot_gives_a_partial_run_and_not_an_exception(here: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TOY_FAIL", "camera:20=stage")
    run = humanmm.recover("film.mp4")
    assert run.state == "partial" and run.origin == "computed"
    assert [(failure.stage, failure.unit) for failure in run.failures] == [("camera", "shot 1")]
    assert str(run.failures[0]) == "camera · shot 1 failed: camera:20 cannot be done"
    assert [shot.failed for shot in run.shots] == [False, True, False]
    assert "camera · shot 1 failed" in run._repr_html_()


@pytest.mark.parametrize(("fault", "error"), [("people=input", InputError), ("shots=stage", StageError)])
def test_what_ends_a_run_is_raised_as_it_is(
    here: Any, monkeypatch: pytest.MonkeyPatch, fault: str, error: type[Exception]
) -> None:
    monkeypatch.setenv("TOY_FAIL", fault)
    with pytest.raises(error):
        humanmm.recover("film.mp4")
    assert not (here.folder / "runs").exists()


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (RuntimeError("Failed to reach API at http://127.0.0.1:1/api/"), "does not respond"),
        (RuntimeError("Timed out while attempting to connect to ephemeral"), "does not respond"),
        (ObjectNotFound(Exception("404")), "cannot record the run .*disk of its database may be full"),
    ],
)
def test_a_server_that_ended_or_cannot_write_is_told_as_that(
    toy: Any, monkeypatch: pytest.MonkeyPatch, error: Exception, message: str
) -> None:
    def fail(*args: Any, **kwargs: Any) -> None:
        raise error

    monkeypatch.chdir(toy.folder)
    monkeypatch.setenv("HUMANMM_STORE", str(toy.store))
    monkeypatch.setattr("humanmm.flows.server.local_server.prefect_server", contextlib.nullcontext)
    monkeypatch.setattr("humanmm.flows.recover.recover", fail)
    with pytest.raises(ResourceError, match=f"Prefect's server {message}"):
        humanmm.recover("film.mp4", progress=False)


def test_it_runs_inside_an_event_loop_as_in_a_notebook(here: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    async def cell(**settings: Any) -> humanmm.Run:
        loop = asyncio.get_running_loop()
        try:
            return humanmm.recover("film.mp4", config=settings)
        finally:
            assert asyncio.get_running_loop() is loop
            await asyncio.sleep(0)

    assert asyncio.run(cell()).state == "done"
    monkeypatch.setenv("TOY_FAIL", "shots=stage")
    with pytest.raises(StageError):
        asyncio.run(cell(shots={"parts": "boxes"}))


def test_it_leaves_the_log_of_the_process_as_it_was(here: Any) -> None:
    logger = logging.getLogger("humanmm")
    before = (list(logger.handlers), logger.level)
    humanmm.recover("film.mp4")
    assert (list(logger.handlers), logger.level) == before
    assert "align" in (here.folder / "runs" / "film" / "run.log").read_text()


def test_settings_come_as_a_tree_a_config_a_file_or_arguments(here: Any) -> None:
    here.run(people={"max_people": 4}, shots={"person": 0}, intrinsics={"focal_px": 900.0})
    (here.folder / "settings.toml").write_text("[people]\nmax_people = 4\n")
    tree = {"people": {"max_people": 4}}
    for config in (tree, humanmm.Config.model_validate(tree), "settings.toml", Path("settings.toml")):
        plan = humanmm.forecast("film.mp4", config=config, person=0, focal_px=900.0)
        assert {entry.state for entry in plan} == {"cached"}
    assert humanmm.forecast("film.mp4", config=tree)[-1].state != "cached"


def test_settings_of_an_older_run_are_read_by_the_names_that_they_had() -> None:
    assert not validate({"refine": {"close_seams": False}}).refine.remove_discontinuities


def test_a_forecast_writes_nothing(here: Any) -> None:
    before = sorted(here.folder.rglob("*"))
    assert {entry.state for entry in humanmm.forecast("film.mp4")} == {"will run", "depends"}
    assert sorted(here.folder.rglob("*")) == before


@pytest.mark.parametrize("wanted", [{"force": True, "only": "hmr"}, {"shot": 1}, {"start": "nothing"}])
def test_arguments_that_contradict_each_other_are_a_usage_error(here: Any, wanted: dict[str, Any]) -> None:
    with pytest.raises(UsageError):
        humanmm.recover("film.mp4", **wanted)
    assert here.executed() == []
