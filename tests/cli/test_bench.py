"""`humanmm bench` as a user types it: which methods a table runs, what it prints, a table from small videos."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from humanmm.cli import main
from humanmm.errors import StageError
from humanmm.models.benchmark import methods
from humanmm.models.benchmark.methods import ABLATIONS, CAMERAS
from humanmm.models.video.colors import BT601
from humanmm.storage.run_folder.picture_files import write_video

PACK = Path(__file__).parents[2] / "data" / "mocap" / "cmu_test.npz"
QUICK = ["--intrinsics.fov_deg", "60", "--camera.static", "true"]
"""Neither focal length nor odometry, of which these tests say nothing."""


def test_the_ablation_turns_every_module_off_and_each_leaves_its_mark(
    short_videos: Callable[..., None], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    short_videos(1)
    command = ["bench", "ablation", "--data", str(PACK), "--size", "tiny", "--store", str(tmp_path / "store"), *QUICK]
    assert main([*command, "--report", str(tmp_path / "report")]) == 0
    rows = json.loads((tmp_path / "report" / "results.json").read_text())["rows"]
    whole = {row["method"]: row for row in rows}
    assert tuple(whole) == ABLATIONS
    assert all((row["n"], row["failed"]) == (1, 0) for row in whole.values())
    metrics = {name: row["metrics"] for name, row in whole.items()}
    for without, figure in (("orientation alignment", "roe_deg"), ("refine", "jitter")):
        assert metrics[f"humanmm without {without}"][figure]["mean"] > metrics["humanmm"][figure]["mean"]
    for part in ("pose prior", "discontinuity removal", "refit", "foot lock"):
        assert metrics[f"humanmm without {part}"] != metrics["humanmm"]
    # No picture, no place that could be recognised.
    assert metrics["humanmm without background links"] == metrics["humanmm"]
    message = capsys.readouterr().out
    assert "| paper: w/o OAM, EMDB-1 (other data) |" in message
    assert "| humanmm without refit (failed 0) |" in message


def test_a_camera_that_fails_is_reported_and_counted_and_takes_no_other_method_with_it(
    short_videos: Callable[..., None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    short_videos(1)

    def unlucky(*arguments: object) -> None:
        raise StageError("no luck")

    monkeypatch.setattr(methods, "true_cameras", unlucky)
    command = ["bench", "camera", "--data", str(PACK), "--size", "tiny", "--store", str(tmp_path), *QUICK[:2]]
    command += ["--refine.refit", "false", "--refine.networks", "none"]
    assert main(command) == 0
    message = capsys.readouterr()
    failures = [line for line in message.err.splitlines() if "failed" in line]
    assert len(failures) == 1
    assert all(line.endswith(": oracle camera failed: no luck") for line in failures)
    table = message.out[message.out.index("## 1 transition") :].splitlines()
    lines = {line[2:].split(" (")[0]: line for line in table if "(failed" in line}
    assert tuple(lines) == CAMERAS
    assert "oracle camera (failed 1) |  |" in lines["oracle camera"]
    assert all("(failed 0) |  |" not in line for name, line in lines.items() if name != "oracle camera")
    assert any(line.startswith("| paper: Masked LEAP-VO, EMDB-2 (other data) |") for line in table)


def test_the_table_of_shots_is_made_from_the_videos_and_is_the_same_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    walls = np.random.default_rng(0).integers(16, 235, (2, 6, 8), np.uint8)
    picture = np.full((2, 180, 160), 128, np.uint8)
    picture[:, :120] = walls.repeat(20, axis=1).repeat(20, axis=2)
    write_video(
        tmp_path / "walls.mp4", ((k / 25, picture[int(k >= 20)]) for k in range(40)), width=160, height=120, fps=25,
        colors=BT601,
    )  # fmt: skip
    (tmp_path / "walls.json").write_text(json.dumps({"transitions": [{"type": "cut", "start": 20, "end": 20}]}))
    (tmp_path / "broken.mp4").write_bytes(b"no video")
    (tmp_path / "broken.json").write_text(json.dumps({"transitions": []}))
    command = ["bench", "shots", "--data", str(tmp_path), "--store", str(tmp_path / "store")]
    assert main([*command, "--report", str(tmp_path / "a")]) == 0
    assert "1 videos, 25 fps, longest 40 frames" in capsys.readouterr().out
    row = json.loads((tmp_path / "a" / "results.json").read_text())["rows"][-1]
    assert (row["method"], row["n"], row["failed"]) == ("humanmm", 2, 1)
    assert row["metrics"]["cut_f1"]["mean"] == 1.0
    assert main([*command, "--report", str(tmp_path / "b"), "--check", str(tmp_path / "a" / "results.json")]) == 0
    assert (tmp_path / "a" / "index.html").read_bytes() == (tmp_path / "b" / "index.html").read_bytes()


def test_flags_of_other_tables_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "shots", "--data", str(tmp_path), "--minutes", "1"]) == 2
    assert main(["bench", "shots", "--data", str(tmp_path), "--size", "tiny"]) == 2
    assert main(["bench", "speed", "--data", str(PACK), "--minutes", "0"]) == 2
    assert "--minutes" in capsys.readouterr().err
