"""`humanmm bench ms-aist` from the command line: the shipped sequence, from 2D detections alone."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from humanmm.cli import main

ROOT = Path(__file__).parents[3]


@pytest.mark.usefixtures("two_methods")
def test_tiny_runs_from_the_shipped_sequence_and_its_baseline_is_bad(
    short_videos: Callable[..., None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    short_videos(2)
    monkeypatch.chdir(ROOT)
    command = ["bench", "ms-aist", "--size", "tiny", "--store", str(tmp_path / "store")]
    assert main([*command, "--report", str(tmp_path / "first")]) == 0
    assert "1 videos, 30 fps, longest 60 frames" in capsys.readouterr().out
    rows = {row["method"]: row for row in json.loads((tmp_path / "first/results.json").read_text())["rows"]}
    ours, concat = rows["humanmm"], rows["concat"]
    assert ours["failed"] == 0
    assert ours["metrics"]["coverage"]["mean"] == 1.0
    assert ours["metrics"]["pa_mpjpe_mm"]["mean"] < 130  # 2D alone; the average pose of a person would give about 150
    assert concat["metrics"]["roe_deg"]["mean"] > ours["metrics"]["roe_deg"]["mean"] + 15
    assert main([*command, "--report", str(tmp_path / "second")]) == 0
    assert (tmp_path / "first/results.json").read_bytes() == (tmp_path / "second/results.json").read_bytes()
