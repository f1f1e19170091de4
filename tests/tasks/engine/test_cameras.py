"""The stages up to the cameras, of a video with nobody in it."""

import contextlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from humanmm.config import Config
from humanmm.config_reading import resolve
from humanmm.errors import ConfigError, HumanMMError, NoUsablePersonError
from humanmm.models.video.colors import Colors
from humanmm.storage.run_folder.picture_files import write_video
from humanmm.storage.store.store import Store
from humanmm.tasks.engine.cameras import recover_cameras
from humanmm.tasks.engine.run import VideoRun
from humanmm.tasks.engine.some_stages import run_stages

SIZE, FRAMES, STEP_PX = (320, 180), 24, 3
NOBODY = resolve(None, {"shots.need_people": False, "focal_px": 300.0})


@pytest.fixture(scope="module")
def empty_room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A camera that moves along a wall of blobs."""
    path = tmp_path_factory.mktemp("room") / "room.mp4"
    noise = np.random.default_rng(3).uniform(0, 255, (60, 200)).astype(np.uint8)
    wall = cv2.resize(noise, (800, 240), interpolation=cv2.INTER_CUBIC)
    pictures = []
    for frame in range(FRAMES):
        view = wall[20 : 20 + SIZE[1], STEP_PX * frame : STEP_PX * frame + SIZE[0]]
        pictures.append((frame / 30, cv2.cvtColor(cv2.cvtColor(view, cv2.COLOR_GRAY2BGR), cv2.COLOR_BGR2YUV_I420)))
    write_video(path, iter(pictures), width=SIZE[0], height=SIZE[1], fps=30.0, colors=Colors(), quality=18)
    return path


def test_a_room_with_nobody_in_it_has_a_camera(empty_room: Path, tmp_path: Path) -> None:
    runs: list[VideoRun] = []
    found = recover_cameras(empty_room, NOBODY, Store(tmp_path / "store"), follow=runs.append)
    (camera,) = found.cameras
    assert (camera.start, camera.end) == (0, FRAMES) and found.shots.people == ()
    assert camera.source in ("rotation_only", "tracked") and found.intrinsics.focal_px == 300.0
    aside = camera.t_shot_cam[-1, 0] + camera.R_shot_cam[-1, 0, 2]  # a flat wall tells no turn from a step aside
    assert aside > 0.05
    assert {unit for unit, _ in runs[0].outcomes} >= {"camera"} and "hmr" not in {
        stage for stage, _ in runs[0].outcomes
    }
    again: list[VideoRun] = []
    recover_cameras(empty_room, NOBODY, Store(tmp_path / "store"), follow=again.append)
    assert {outcome.state for outcome in again[0].outcomes.values()} == {"cached"}


def test_a_recovery_of_it_says_what_to_do(empty_room: Path, tmp_path: Path) -> None:
    store = Store(tmp_path / "store")
    with pytest.raises(NoUsablePersonError):
        run_stages(empty_room, ("decode", "scenes", "people", "points", "shots"), Config(), store)
    names = ("decode", "scenes", "people", "points", "shots", "keyframes", "intrinsics", "camera", "hmr", "align")
    with pytest.raises(NoUsablePersonError, match="humanmm camera"):
        run_stages(empty_room, names, NOBODY, store)


@pytest.mark.parametrize("names", [("decode",), ("decode", "deliver")])
def test_what_computes_for_it_has_ended_afterwards(
    empty_room: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, names: tuple[str, ...]
) -> None:
    closed: list[VideoRun] = []
    monkeypatch.setattr(VideoRun, "close", lambda run: closed.append(run))
    runs: list[VideoRun] = []
    with contextlib.suppress(HumanMMError):  # no recording without people
        run_stages(empty_room, names, NOBODY, Store(tmp_path / "store"), follow=runs.append)
    assert closed == runs and len(runs) == 1


def test_a_runner_that_is_not_installed_is_reported_before_anything_is_computed(
    empty_room: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(ConfigError, match=r"run.runner = ray needs a library .* pip install 'humanmm\[ray\]'"):
        run_stages(empty_room, ("decode",), resolve(None, {"run.runner": "ray"}), Store(tmp_path / "store"))
