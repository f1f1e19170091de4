"""`humanmm bench ms-mocap` from the command line: computed once, the same bytes again, worse is told."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from humanmm.cli import main
from humanmm.config import Config
from humanmm.flows import motion_benchmark
from humanmm.flows.motion_benchmark import mocap_set
from humanmm.models.benchmark.methods import METHODS
from humanmm.storage.code_digest import CodeDigest


def test_tiny_is_computed_once_and_then_the_same_to_the_byte(
    pack: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["bench", "ms-mocap", "--data", str(pack), "--size", "tiny", "--store", str(tmp_path / "store")]
    first, second = tmp_path / "first", tmp_path / "second"
    assert main([*command, "--report", str(first)]) == 0
    told = capsys.readouterr().out
    assert "2 videos, 30 fps, longest 72 frames" in told
    tree = json.loads((first / "results.json").read_text())
    assert {row["method"] for row in tree["rows"]} == set(METHODS)
    assert {row["split"] for row in tree["rows"]} == {"2 transitions", "3 transitions", "all"}
    assert str(tmp_path) not in (first / "results.json").read_text()

    def never(*arguments: object) -> None:
        raise AssertionError("computed again")

    monkeypatch.setattr(motion_benchmark, "compute", never)
    assert main([*command, "--report", str(second), "--check", str(first / "results.json")]) == 0
    for path in first.iterdir():
        assert path.read_bytes() == (second / path.name).read_bytes()

    better = first / "results.json"
    for row in tree["rows"]:
        row["metrics"]["roe_deg"].update(ci95=[0.0, 0.1])
    better.write_text(json.dumps(tree))
    capsys.readouterr()
    assert main([*command, "--check", str(better)]) == 1
    assert "worse: humanmm, 2 transitions: roe_deg" in capsys.readouterr().err
    assert main([*command, "--report", str(first)]) == 1  # another result is not overwritten


def test_a_change_of_the_metrics_leaves_the_motions_as_they_are(pack: Path) -> None:
    jobs, _ = mocap_set(pack, "tiny")
    code = CodeDigest({"a": "1"}, {}, {})
    metrics = replace(code, modules={"a": "1", "b": "1"})
    before = motion_benchmark._recipes(jobs[0], Config(), (code, code), METHODS)
    after = motion_benchmark._recipes(jobs[0], Config(), (code, metrics), METHODS)
    assert before[0].key == after[0].key
    assert before[1].key != after[1].key


def test_a_setting_or_another_video_makes_other_motions(pack: Path) -> None:
    jobs, _ = mocap_set(pack, "tiny")
    code = CodeDigest({}, {}, {})
    config = Config.model_validate({"refine": {"cutoff_hz": 5.0}})
    keys = {motion_benchmark._recipes(job, c, (code, code), METHODS)[0].key for job in jobs for c in (Config(), config)}
    assert len(keys) == 2 * len(jobs)


def test_a_pack_that_is_none_is_told_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "pack.npz").write_bytes(b"no zip")
    assert main(["bench", "ms-mocap", "--data", str(tmp_path / "pack.npz")]) == 1
    assert len(capsys.readouterr().err.splitlines()) == 1
