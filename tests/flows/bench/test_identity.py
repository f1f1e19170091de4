"""`humanmm bench identity`: which clips of a folder have known people; what the stages find is made by arithmetic."""

from pathlib import Path

import numpy as np
import pytest

from humanmm.cli import main
from humanmm.config import Config
from humanmm.errors import InputError
from humanmm.flows.bench import identity
from humanmm.flows.bench.identity import known_clips
from humanmm.storage.store.store import Store

LIST = """
[[clip]]
name = "street"
shows = "A man."
parts = [{ video = "street/a.mp4" }]
[[clip.people]]
who = "man"
frames = [[0, 30]]
at = [[0, 0.3, 0.2, 0.7, 0.9]]

[[clip]]
name = "piece"
shows = "The same."
parts = [{ video = "street/a.mp4", frames = [0, 5] }]

[[clip]]
name = "joined"
shows = "Two places."
parts = [{ video = "joined.mp4" }]
cuts = [{ start = 5, end = 5, linked = false }]
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "golden.toml").write_text(LIST)
    (tmp_path / "street").mkdir()
    for name in ("street/a.mp4", "joined.mp4", "rendered.mp4", "joints_only.mp4"):
        (tmp_path / name).touch()
    box = np.array([[10.0, 20, 30, 40]])
    np.savez(tmp_path / "rendered_gt.npz", **{"people/00/frame": np.array([3]), "people/00/bbox": box})
    np.savez(tmp_path / "joints_only_gt.npz", joints=np.zeros(3))
    return tmp_path


def test_people_are_known_by_a_truth_with_boxes_or_in_a_whole_video_of_one_recording(folder: Path) -> None:
    clips = list(known_clips(folder))
    assert [(clip.video.name, clip.recording) for clip in clips] == [("rendered.mp4", "rendered"), ("a.mp4", "street")]


def test_a_clip_that_fails_is_reported(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def failing(video: Path, names: tuple[str, ...], config: Config, store: Store) -> None:
        raise InputError(f"{video.name} is empty")

    monkeypatch.setattr(identity, "run_stages", failing)
    assert main(["bench", "identity", "--data", str(folder), "--store", str(folder / "store")]) == 0
    assert "rendered.mp4 is empty" in capsys.readouterr().err


def test_a_folder_without_known_people_is_reported(tmp_path: Path) -> None:
    (tmp_path / "golden.toml").write_text(LIST)
    with pytest.raises(InputError, match="none of the golden set's"):
        identity.identity_views(tmp_path, Config(), Store(tmp_path / "store"))
