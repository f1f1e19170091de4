"""The background of a run, read from its store; and a warning where that has it no more."""

import json
import logging
import shutil
from pathlib import Path

import numpy as np
import pytest
import two_people

import humanmm
from humanmm.models.records.camera import ShotCamera
from humanmm.storage.run_folder.kept_scenery import kept_scenery
from humanmm.storage.run_folder.motion_zarr import write_motion
from humanmm.storage.run_folder.run_record import SCHEMA
from humanmm.storage.store.open import open_store
from humanmm.storage.store.recipe import Recipe

RECORDING = two_people.recording()
POINTS = np.random.default_rng(0).uniform([-2, 1, 0], [2, 6, 2], (30, 3))
RECIPE = Recipe("camera", 1, {"start": 0}, {}, {}, {}, {}, {})


@pytest.fixture
def run_dir(tmp_path: Path) -> Path:
    """A run whose first camera travels; the second shot failed."""
    store, run_dir = open_store(tmp_path / "store"), tmp_path / "run"
    camera = two_people.travelling_camera(POINTS, np.full(30, 0.01), unit_m=0.4)
    with store.new_folder() as folder:
        store.commit(folder, camera, ShotCamera, RECIPE, unit="shot 0", seconds=1.0, version="0")
    run_dir.mkdir()
    write_motion(run_dir / "motion.zarr", RECORDING)
    stages = [{"stage": "camera", "shot": shot, "key": key} for shot, key in ((0, RECIPE.key), (1, None))]
    (run_dir / "run.json").write_text(json.dumps({"schema": SCHEMA, "store": store.location, "stages": stages}))
    return run_dir


def test_an_export_has_the_points_that_the_store_holds(run_dir: Path, caplog: pytest.LogCaptureFixture) -> None:
    *_, points = humanmm.load(run_dir).export("colmap")
    found = np.loadtxt(points)
    np.testing.assert_allclose(found[:, 1:4], POINTS, atol=1e-4)
    assert not caplog.records


def test_without_the_store_the_cameras_are_written_and_a_warning_says_what_is_missing(
    run_dir: Path, caplog: pytest.LogCaptureFixture
) -> None:
    shutil.rmtree(run_dir.parent / "store")
    with caplog.at_level(logging.WARNING):
        *_, points = humanmm.load(run_dir).export("colmap")
    assert points.read_text() == "# no points\n"
    assert "shot 0 are left out" in caplog.text and "recover --from camera" in caplog.text
    assert not (run_dir.parent / "store").exists(), "reading makes no store"


def test_a_record_that_names_no_store_is_a_warning(run_dir: Path, caplog: pytest.LogCaptureFixture) -> None:
    (run_dir / "run.json").unlink()
    with caplog.at_level(logging.WARNING):
        assert kept_scenery(run_dir, RECORDING) == {}
    assert "run.json" in caplog.text
