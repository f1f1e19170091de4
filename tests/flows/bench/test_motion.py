"""`humanmm bench ms-mocap` from the command line: computed once, the same bytes again, worse is told."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from humanmm.cli import main
from humanmm.config import Config
from humanmm.flows.bench import motion as motion_benchmark
from humanmm.flows.bench.motion import FIGURE_CODE
from humanmm.flows.bench.planned import mocap_set
from humanmm.models.benchmark.methods import ABLATIONS, METHODS
from humanmm.storage.store.open import open_store
from humanmm.tasks.units.digest import CodeDigest


def test_tiny_is_computed_once_and_then_the_same_to_the_byte(
    pack: Path, short_videos: Callable[..., None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    short_videos(1)
    command = ["bench", "ms-mocap", "--data", str(pack), "--size", "tiny", "--store", str(tmp_path / "store")]
    # neither the focal length nor how a motion is refined is what this test is about
    command += ["--intrinsics.fov_deg", "60", "--refine.refit", "false", "--refine.networks", "none"]
    first, second = tmp_path / "first", tmp_path / "second"
    assert main([*command, "--report", str(first)]) == 0
    message = capsys.readouterr().out
    assert "1 videos, 30 fps, longest 40 frames" in message
    tree = json.loads((first / "results.json").read_text())
    assert {row["method"] for row in tree["rows"]} == set(METHODS)
    assert {row["split"] for row in tree["rows"]} == {"1 transition"}
    for folder in (tmp_path, pack.parent):
        assert str(folder) not in (first / "results.json").read_text()

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
    assert "worse: humanmm, 1 transition: roe_deg" in capsys.readouterr().err
    assert main([*command, "--report", str(first)]) == 1  # another result is not overwritten


def test_a_change_of_the_metrics_leaves_the_motions_as_they_are(pack: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    jobs, _ = mocap_set(pack, "tiny")
    before = motion_benchmark.recipes_of(jobs[0], Config(), METHODS)
    code = motion_benchmark.code_of

    def with_another_metric(*modules: str, **more: Any) -> CodeDigest:
        digest = code(*modules, **more)
        return replace(digest, modules={**digest.modules, "b": "1"}) if FIGURE_CODE in modules else digest

    monkeypatch.setattr(motion_benchmark, "code_of", with_another_metric)
    after = motion_benchmark.recipes_of(jobs[0], Config(), METHODS)
    assert before.motions.key == after.motions.key
    assert before.figures.key != after.figures.key


def test_a_setting_another_video_or_other_methods_make_other_motions(pack: Path) -> None:
    jobs, _ = mocap_set(pack, "tiny")
    config = Config.model_validate({"refine": {"cutoff_hz": 5.0}})
    recipes = [
        motion_benchmark.recipes_of(job, c, methods)
        for job in jobs
        for c in (Config(), config)
        for methods in (METHODS, ABLATIONS)
    ]
    assert len({recipe.motions.key for recipe in recipes}) == 4 * len(jobs)


def test_a_pack_that_is_none_is_reported_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "pack.npz").write_bytes(b"no zip")
    assert main(["bench", "ms-mocap", "--data", str(tmp_path / "pack.npz")]) == 1
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.slow
def test_figures_in_a_bucket_are_computed_once_for_all_hosts(
    pack: Path, bucket: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    jobs, _ = mocap_set(pack, "tiny")
    one = METHODS[:1]
    first = motion_benchmark.figures_of(jobs[:1], Config(), open_store(bucket), one)
    monkeypatch.setenv("HUMANMM_CACHE", str(tmp_path / "another host"))
    monkeypatch.setattr(motion_benchmark, "compute", None)
    assert motion_benchmark.figures_of(jobs[:1], Config(), open_store(bucket), one) == first
