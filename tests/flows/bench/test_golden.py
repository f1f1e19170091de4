"""`humanmm bench golden` and `overlay` on folders of their own; what is recovered is made by arithmetic."""

import json
from pathlib import Path

import numpy as np
import pytest
from standing_person import HEIGHT, NUM_FRAMES, WIDTH, recording_of, standing, standing_person

from humanmm.cli import main
from humanmm.config import Config
from humanmm.errors import InputError
from humanmm.flows.bench import golden
from humanmm.models.benchmark.golden import SeenClip
from humanmm.models.records.recording import Recording
from humanmm.models.video.colors import BT601
from humanmm.storage.run_folder.picture_files import write_video
from humanmm.storage.store.store import Store

__all__ = ["standing"]

LIST = """
[[clip]]
name = "whole"
shows = "A woman."
parts = [{ video = "a.mp4" }]
camera = "static"
[[clip.people]]
who = "woman"
frames = [[0, 30]]
at = [[0, 0.35, 0.22, 0.65, 0.88]]

[[clip]]
name = "piece"
shows = "Nobody."
parts = [{ video = "a.mp4", frames = [0, 5] }]

[[clip]]
name = "elsewhere"
shows = "Another video."
parts = [{ video = "b.mp4" }]
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HUMANMM_CACHE", str(tmp_path / "cache"))
    (tmp_path / "golden.toml").write_text(LIST)
    gray = np.full((HEIGHT * 3 // 2, WIDTH), 128, np.uint8)
    pictures = ((frame / 30, gray) for frame in range(NUM_FRAMES))
    write_video(tmp_path / "a.mp4", pictures, width=WIDTH, height=HEIGHT, fps=30, colors=BT601)
    return tmp_path


def test_the_table_has_a_row_a_clip_and_says_what_is_left_out(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    seen = SeenClip(NUM_FRAMES, recording_of(standing_person()), {})
    monkeypatch.setattr(golden, "recovered", lambda video, config, store: seen)
    command = ["bench", "golden", "--data", str(folder), "--store", str(folder / "store")]
    assert main([*command, "--report", str(folder / "report")]) == 0
    message = capsys.readouterr()
    assert "b.mp4" in message.err
    assert "6 of 7 expectations hold" in message.out
    assert "| piece | elsewhere |" in message.out
    rows = {row["split"]: row for row in json.loads((folder / "report/results.json").read_text())["rows"]}
    assert (rows["whole"]["n"], rows["whole"]["failed"]) == (5, 0)
    assert (rows["piece"]["n"], rows["piece"]["failed"]) == (2, 1)
    assert "What holds" in (folder / "report/README.md").read_text()
    assert main([*command, "--check", str(folder / "report/results.json")]) == 0


def test_a_size_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "golden", "--data", str(folder), "--size", "tiny"]) == 2
    assert "golden takes no --size" in capsys.readouterr().err


def test_a_piece_is_cut_once(folder: Path) -> None:
    clip = golden.golden_list(folder)[1]
    path = golden.video_of(clip, folder, Store(folder / "store"))
    first = path.stat().st_mtime_ns
    assert golden.video_of(clip, folder, Store(folder / "store")) == path
    assert path.stat().st_mtime_ns == first


def test_without_a_list_of_its_own_a_folder_has_the_repositorys(tmp_path: Path) -> None:
    assert len(golden.golden_list(tmp_path)) >= 25


def test_a_folder_without_the_videos_is_reported(tmp_path: Path, folder: Path) -> None:
    (folder / "a.mp4").unlink()
    with pytest.raises(InputError, match="holds none of the videos"):
        golden.checked_clips(folder, Config(), Store(tmp_path / "store"))


def test_every_video_below_the_folder_has_a_row_and_a_refused_one_is_reported(
    standing: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    seen = {
        "a": SeenClip(NUM_FRAMES, standing, {}),
        "b": SeenClip(NUM_FRAMES, None, {}, refused="no usable person: nobody is seen"),
    }
    (tmp_path / "deeper").mkdir()
    for path in ("a.mp4", "deeper/b.mkv", "notes.txt"):
        (tmp_path / path).touch()
    monkeypatch.setattr(golden, "recovered", lambda video, config, store: seen[video.stem])
    command = ["bench", "overlay", "--data", str(tmp_path), "--store", str(tmp_path / "store")]
    assert main([*command, "--report", str(tmp_path / "report")]) == 0
    assert "deeper/b: no usable person" in capsys.readouterr().err
    rows = {row["split"]: row for row in json.loads((tmp_path / "report/results.json").read_text())["rows"]}
    assert rows["a"]["metrics"]["p95_pct"]["mean"] < 1e-3
    assert rows["deeper/b"]["failed"] == 1
    assert {"all", "fastest 5 %"} <= set(rows)


def test_a_folder_without_videos_is_reported(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no folder that holds videos"):
        golden.overlays(tmp_path, Config(), Store(tmp_path / "store"))
