"""`humanmm bench overlay` on a folder of videos; what is recovered is made by arithmetic."""

import json
from pathlib import Path

import pytest
from standing_person import NUM_FRAMES, standing

from humanmm.cli import main
from humanmm.config import Config
from humanmm.errors import InputError
from humanmm.flows.bench import overlay
from humanmm.models.benchmark.golden import SeenClip
from humanmm.models.records.recording import Recording
from humanmm.storage.store.store import Store

__all__ = ["standing"]


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
    monkeypatch.setattr(overlay, "recovered", lambda video, config, store: seen[video.stem])
    command = ["bench", "overlay", "--data", str(tmp_path), "--store", str(tmp_path / "store")]
    assert main([*command, "--report", str(tmp_path / "report")]) == 0
    assert "deeper/b: no usable person" in capsys.readouterr().err
    rows = {row["split"]: row for row in json.loads((tmp_path / "report/results.json").read_text())["rows"]}
    assert rows["a"]["metrics"]["p95_pct"]["mean"] < 1e-3
    assert rows["deeper/b"]["failed"] == 1
    assert {"all", "fastest 5 %"} <= set(rows)


def test_a_folder_without_videos_is_reported(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no folder that holds videos"):
        overlay.overlays(tmp_path, Config(), Store(tmp_path / "store"))
