"""`humanmm bench identity | lifting`: which clips have known people; what the stages find is made by arithmetic."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from humanmm.cli import main
from humanmm.config import Config
from humanmm.errors import InputError
from humanmm.flows.bench import perception
from humanmm.flows.bench.perception import known_clips
from humanmm.models.evaluation.landmarks import LandmarkErrors
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

    monkeypatch.setattr(perception, "run_stages", failing)
    assert main(["bench", "identity", "--data", str(folder), "--store", str(folder / "store")]) == 0
    assert "rendered.mp4 is empty" in capsys.readouterr().err


def test_a_folder_without_known_people_is_reported(tmp_path: Path) -> None:
    (tmp_path / "golden.toml").write_text(LIST)
    with pytest.raises(InputError, match="none of the golden set's"):
        perception.identity_views(tmp_path, Config(), Store(tmp_path / "store"))


def test_lifters_are_measured_on_clips_with_truths_and_those_that_fail_are_reported(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "joints_only.mp4").unlink()
    errors = LandmarkErrors(*(np.full(4, mm) for mm in (50.0, 70.0, 30.0, 35.0)))

    def measured(truth: Path, config: Config, store: Store) -> Iterator[tuple[str, LandmarkErrors]]:
        if truth.name.startswith("bad"):
            raise InputError("it is empty")
        yield "lifter", errors

    (folder / "bad.mp4").touch()
    (folder / "bad_gt.npz").touch()
    monkeypatch.setattr(perception, "_errors_in", measured)
    assert main(["bench", "lifting", "--data", str(folder), "--store", str(folder / "store")]) == 0
    said = capsys.readouterr()
    assert "| lifter | 1 | 4 | 50.0, 50.0 | 70.0, 70.0 | 30.0, 30.0 | 35.0, 35.0 |" in said.out
    assert "bad.mp4: it is empty" in said.out + said.err
    with pytest.raises(InputError, match="holds no video beside"):
        perception.lifted_landmarks(folder / "street", Config(), Store(folder / "store"))
