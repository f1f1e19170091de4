"""`scripts/measure_scale` on a few videos: every figure that docs/scale.md is made of is there and possible."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.mark.server
@pytest.mark.timeout(2400)
def test_a_small_batch_is_measured_and_its_dashboard_is_current_within_a_minute(tmp_path: Path) -> None:
    command = [sys.executable, str(ROOT / "scripts/measure_scale"), "--videos", "3", "--json", str(tmp_path / "f.json")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    figures = json.loads((tmp_path / "f.json").read_text())
    assert (figures["videos"], figures["states"], figures["tasks a video"]) == (3, {"done": 3}, 20)
    assert figures["dashboard current after the last video, s"] < 60
    seconds = {name: value for name, value in figures.items() if name.startswith("processor seconds")}
    assert len(seconds) == 9 and all(0 < value < 60 for value in seconds.values()), seconds
    assert 0 < figures["database growth a video, kB"] < 400 and figures["store a video, kB"] > 0
    assert f"{'videos':<{max(map(len, figures))}}  3\n" in done.stdout
