"""`bench ms-real` and `bench speed` on the real clip that the repository holds."""

import json
from pathlib import Path
from typing import Any

import pytest

from humanmm.cli import main

EXAMPLES = Path(__file__).parents[3] / "examples"
CLIP = EXAMPLES / "pose2sim_multishot" / "pose2sim_A_01-02-01.mp4"

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]


def rows_of(report: Path) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = json.loads((report / "results.json").read_text())["rows"]
    return rows


def test_the_real_clip_is_measured_once_and_drawn(tmp_path: Path) -> None:
    command = ["bench", "ms-real", "--data", str(CLIP.parent), "--store", str(tmp_path / "store")]
    assert main([*command, "--report", str(tmp_path / "a")]) == 0
    first = {row["method"]: row for row in rows_of(tmp_path / "a")}
    assert all((row["n"], row["failed"]) == (1, 0) for row in first.values())
    assert first["humanmm"]["metrics"]["coverage"]["mean"] > 0.95
    assert first["humanmm"]["metrics"]["cut_f1"]["mean"] == 1.0
    assert first["concat"]["metrics"]["wa_mpjpe100_mm"]["mean"] > first["humanmm"]["metrics"]["wa_mpjpe100_mm"]["mean"]
    assert (tmp_path / "a" / "overlays" / CLIP.name).stat().st_size > 0
    assert f'href="overlays/{CLIP.name}"' in (tmp_path / "a" / "index.html").read_text()
    assert main([*command, "--report", str(tmp_path / "b"), "--check", str(tmp_path / "a" / "results.json")]) == 0
    assert (tmp_path / "a" / "results.json").read_bytes() == (tmp_path / "b" / "results.json").read_bytes()


def test_speed_and_its_growth_are_measured_in_processes_of_their_own(tmp_path: Path) -> None:
    report = tmp_path / "speed"
    assert main(["bench", "speed", "--data", str(CLIP), "--minutes", "0.03", "0.06", "--report", str(report)]) == 0
    short, long = rows_of(report)
    assert [row["metrics"]["num_frames"]["mean"] for row in (short, long)] == [200, 300]  # whole turns of 100 frames
    for row in (short, long):
        for stage in ("decode", "people", "refine", "deliver"):
            assert row["metrics"][f"{stage}_ms_per_frame"]["mean"] > 0
        assert row["metrics"]["ratio_to_floor"]["mean"] > 1
    assert "memory_growth_kb_per_frame" in long["metrics"]
