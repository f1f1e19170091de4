"""`humanmm bench` as a user types it: which methods a table runs, what it prints, a table from small videos."""

import json
from pathlib import Path

import numpy as np
import pytest

from humanmm.cli import main
from humanmm.flows import motion_benchmark
from humanmm.models.benchmark.methods import ABLATIONS, CAMERAS
from humanmm.models.benchmark.scoring import Figure, MethodFigures, VideoFigures
from humanmm.models.video.colors import BT601
from humanmm.storage.picture_files import write_video

PACK = Path(__file__).parents[2] / "data" / "mocap" / "cmu_test.npz"


@pytest.mark.parametrize(
    ("table", "methods", "beside"),
    [("ablation", ABLATIONS, "paper: w/o OAM, EMDB-1"), ("camera", CAMERAS, "paper: Masked LEAP-VO, EMDB-2")],
)
def test_a_table_of_modules_has_a_line_for_each_method_and_the_papers_beside_it(
    table: str,
    methods: tuple[str, ...],
    beside: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def measured(jobs: list[object], config: object, store: object, wanted: tuple[str, ...]) -> list[VideoFigures]:
        figures = (Figure("wa_mpjpe100_mm", 90.0), Figure("cam_shot_ate_m", 0.01))
        done = (
            *(MethodFigures(name, figures, ()) for name in wanted[:-1]),
            MethodFigures(wanted[-1], (), (), "no luck"),
        )
        return [VideoFigures(f"video {k}", "2 transitions", done) for k in range(len(jobs))]

    monkeypatch.setattr(motion_benchmark, "figures_of", measured)
    command = ["bench", table, "--data", str(PACK), "--size", "tiny", "--store", str(tmp_path)]
    assert main(command) == 0
    told = capsys.readouterr()
    assert f"humanmm: video 1: {methods[-1]} failed: no luck" in told.err
    lines = told.out.splitlines()
    assert [line.split(" (failed")[0][2:] for line in lines if "(failed" in line] == list(methods)
    assert any(line.startswith(f"| {beside}") for line in lines)


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
