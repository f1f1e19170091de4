"""What `humanmm view` writes: films with the frames and times of the video, and nothing over a file unasked."""

import hashlib
import shutil
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
import two_people

import humanmm
from humanmm.config import Config
from humanmm.errors import InputError
from humanmm.models.records.recording import Delivery, Recording
from humanmm.models.video.colors import BT601
from humanmm.models.video.reading import read_facts
from humanmm.storage.run_folder.motion_zarr import ASKED_VIEWS, write_run_folder
from humanmm.storage.run_folder.picture_files import write_video
from humanmm.storage.run_folder.run_record import SCHEMA, write_run_record
from humanmm.tasks.films import layout_of
from humanmm.tasks.views import FILES


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """40 white pictures at a variable rate."""
    path = tmp_path_factory.mktemp("video") / "film.mp4"
    white = np.full((1080, 1280), 128, np.uint8)
    white[:720] = 200
    times = np.cumsum(np.random.default_rng(0).uniform(0.02, 0.05, 40))
    write_video(path, ((time, white) for time in times), width=1280, height=720, fps=30, colors=BT601)
    return path


@pytest.fixture(scope="module")
def recording(video: Path) -> Recording:
    """Two people at the times of the video."""
    with video.open("rb") as stream:
        return two_people.recording(time_s=read_facts(stream).time_s)


@pytest.fixture(scope="module")
def viewed(recording: Recording, video: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run of that video, with both of its films."""
    folder = tmp_path_factory.mktemp("viewed")
    run_dir = folder / "run"
    write_run_folder(run_dir, Delivery(recording, ()), folder)
    shots = [
        {"start": 0, "end": 25, "transition": None, "linked": True, "join": None, "people": [0, 1], "failed": False},
        {"start": 25, "end": 40, "transition": None, "linked": True, "join": None, "people": [0, 1], "failed": False},
    ]
    record: dict[str, Any] = {
        "schema": SCHEMA, "shots": shots, "warnings": [], "failures": [],
        "video": {"path": str(video), "sha256": hashlib.sha256(video.read_bytes()).hexdigest()},
        "config": Config().model_dump(mode="json"),
    }  # fmt: skip
    write_run_record(run_dir, record)
    for kind in ("world", "side-by-side"):
        assert humanmm.load(run_dir).view(kind) == run_dir / "view" / f"{kind}.mp4"
    return run_dir


@pytest.fixture
def run_dir(viewed: Path, tmp_path: Path) -> Path:
    """A copy of it."""
    return Path(shutil.copytree(viewed, tmp_path / "run"))


def _frames(path: Path) -> list[Any]:
    with av.open(str(path)) as container:
        return list(container.decode(video=0))


@pytest.mark.parametrize("kind", ["world", "side-by-side"])
def test_a_film_has_the_frames_and_times_of_the_video(viewed: Path, recording: Recording, kind: str) -> None:
    frames = _frames(viewed / "view" / f"{kind}.mp4")
    assert (frames[0].width, frames[0].height) == (1280, 720)
    np.testing.assert_allclose([f.time for f in frames], recording.time_s - recording.time_s[0], atol=1e-4)
    picture = frames[20].to_ndarray(format="rgb24").astype(int)
    blue = picture[..., 2] - picture[..., 0]
    assert (blue > 60).any()


def test_side_by_side_shows_the_original_over_the_overlay_left_of_the_world(viewed: Path) -> None:
    picture = _frames(viewed / "view" / "side-by-side.mp4")[20].to_ndarray(format="rgb24").astype(int)
    original, overlay, world = picture[:360, :640], picture[360:, :640], picture[:, 640:]
    assert original.min() > 190, "white, without anybody"
    assert overlay.min() < 100 and np.median(overlay) > 190
    assert np.median(world) < 80


def test_bodies_are_as_opaque_as_asked_for(run_dir: Path) -> None:
    clear_film = humanmm.load(run_dir).view("side-by-side", out=run_dir / "clear.mp4", opacity=0.0)
    clear, solid = (
        _frames(film)[20].to_ndarray()[360:700, :640] for film in (clear_film, run_dir / "view" / "side-by-side.mp4")
    )
    assert (solid < 160).mean() > 2 * (clear < 160).mean()


def test_a_page_is_written_where_there_is_none_and_kept_where_there_is_one(run_dir: Path) -> None:
    run = humanmm.load(run_dir)
    page = run.view()
    assert page == run_dir / "view" / "scene.html" and "humanmm" in page.read_text()
    page.write_text("mine")
    assert run.view() == page and page.read_text() == "mine"
    assert run.view(force=True).stat().st_size > 1e6
    with pytest.raises(InputError, match="exists already"):
        run.view(opacity=0.5)


def test_a_film_that_is_there_is_replaced_only_when_asked(run_dir: Path) -> None:
    run = humanmm.load(run_dir)
    with pytest.raises(InputError, match="--force"):
        run.view("world")
    assert run.view("world", force=True) == run_dir / "view" / "world.mp4"


def test_a_view_goes_neither_over_a_folder_nor_below_a_file(run_dir: Path, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    run = humanmm.load(run_dir)
    with pytest.raises(InputError, match=r"is a folder; name a file with --out"):
        run.view(out=tmp_path, force=True)
    with pytest.raises(InputError, match=r"cannot be made: .*file is a file; name another with --out"):
        run.view(out=tmp_path / "file" / "page.html")


def test_films_of_a_motion_that_is_replaced_go_away(run_dir: Path, recording: Recording, tmp_path: Path) -> None:
    assert set(ASKED_VIEWS) == set(FILES.values()) - {"scene.html"}
    film = run_dir / "view" / "world.mp4"
    write_run_folder(run_dir, Delivery(recording, ()), tmp_path)
    assert film.exists(), "the same motion"
    write_run_folder(run_dir, Delivery(two_people.recording(), ()), tmp_path)
    assert not film.exists()


def test_a_tall_video_stands_beside_its_overlay_and_a_small_one_is_not_enlarged(run_dir: Path, tmp_path: Path) -> None:
    def layout(width: int, height: int) -> Any:
        path = tmp_path / f"{width}.mp4"
        pictures = ((i / 10, np.full((height * 3 // 2, width), 128, np.uint8)) for i in range(3))
        write_video(path, pictures, width=width, height=height, fps=10, colors=BT601)
        with path.open("rb") as stream:
            return layout_of(read_facts(stream))

    tall = layout(720, 1280)
    assert (tall.cell, tall.overlay, tall.size[1]) == ((404, 720), (404, 0), 720)
    small = layout(426, 240)
    assert (small.cell, small.overlay, small.size) == ((426, 240), (0, 240), (852, 480))
