"""`humanmm dataset build`: which clips are made, and what a user is told before anything is overwritten."""

import pickle
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from humanmm.cli import main
from humanmm.flows.bench import render_set
from humanmm.flows.bench.render_set import SEED, SetPlan, shipped_packs

FRAMES = 3


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """3DPW with two videos of three frames."""
    (tmp_path / "3dpw" / "sequenceFiles" / "test").mkdir(parents=True)
    tree = {
        "cam_poses": np.tile(np.eye(4), (FRAMES, 1, 1)), "cam_intrinsics": np.diag([60.0, 60.0, 1.0]),
        "jointPositions": [np.zeros((FRAMES, 72))], "campose_valid": [np.ones(FRAMES, int)],
    }  # fmt: skip
    for name in ("cafe_00", "park_00"):
        folder = tmp_path / "3dpw" / "imageFiles" / name
        folder.mkdir(parents=True)
        for frame in range(FRAMES):
            cv2.imwrite(str(folder / f"image_{frame:05d}.jpg"), np.full((64, 48, 3), 40, np.uint8))
        path = tmp_path / "3dpw" / "sequenceFiles" / "test" / f"{name}.pkl"
        path.write_bytes(pickle.dumps({**tree, "sequence": name}, protocol=2))
    return tmp_path / "3dpw"


def _build(root: Path, out: Path, *flags: str) -> int:
    return main(["dataset", "build", "3dpw", "--root", str(root), "--out", str(out), *flags])


def test_only_the_first_sequences_are_built_if_fewer_are_wanted(
    root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert _build(root, out, "--count", "1") == 0
    assert [path.name for path in out.glob("*.mp4")] == ["cafe_00.mp4"]
    told, folder = capsys.readouterr().out.splitlines()
    assert told == f"measure with: humanmm bench ms-real --data {out}" and folder == str(out)


def test_what_is_there_is_replaced_only_when_asked(
    root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    assert _build(root, out) == 0, "an empty folder is nobody's"
    mine = (out / "cafe_00.mp4").stat().st_mtime_ns
    assert _build(root, out) == 1
    assert "is not empty; give --force" in capsys.readouterr().err
    assert (out / "cafe_00.mp4").stat().st_mtime_ns == mine
    assert _build(root, out, "--force") == 0
    assert (out / "cafe_00.mp4").stat().st_mtime_ns > mine


@pytest.mark.parametrize(
    "words", ["ms-aist", "ms-h36m", "3dpw", "emdb --split 1 --smpl smpl.npz", "rich --split test --smplx models"]
)
def test_a_folder_that_is_not_there_is_told_before_anything_is_read(
    words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["dataset", "build", *words.split(), "--root", str(tmp_path / "none"), "--out", str(tmp_path / "out")]
    assert main(command) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "none is not a folder; --root must be the data set's own folder" in line


@pytest.fixture
def planned(monkeypatch: pytest.MonkeyPatch) -> list[tuple[SetPlan, dict[str, Any]]]:
    """The plans of which clips would have been rendered."""
    plans: list[tuple[SetPlan, dict[str, Any]]] = []

    def build(plan: SetPlan, out: Path, **more: Any) -> Path:
        plans.append((plan, more))
        return out

    monkeypatch.setattr(render_set, "build_set", build)
    return plans


def test_a_rendered_set_is_the_one_that_the_user_describes(
    planned: list[Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["dataset", "build", "ms-render", "--out", str(tmp_path)]
    assert main(command) == 0
    words = "--size places --split test --count 3 --seconds 2 2.5 --resolution 96 54 --seed 0 --threads 1 --force"
    assert main([*command, *words.split()]) == 0
    assert main([*command, "--mocap", "mine.npz"]) == 0
    plain, described, own = planned
    assert plain == (SetPlan(shipped_packs("standard", "dev"), "standard", SEED), {"threads": 2, "force": False})
    packs = shipped_packs("places", "test")
    plan = SetPlan(packs, "places", 0, 3, seconds=(2.0, 2.5), resolution=(96, 54), split="test")
    assert described == (plan, {"threads": 1, "force": True})
    assert own[0].packs == (Path("mine.npz"),)
    assert capsys.readouterr().out.splitlines() == [str(tmp_path)] * 3


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--resolution 97 54", "two even numbers of at least 16"),
        ("--resolution 96 8", "two even numbers of at least 16"),
        ("--seconds 3 2", "two rising positive numbers"),
        ("--seconds 0 2", "two rising positive numbers"),
    ],
)
def test_a_size_that_no_clip_can_have_is_refused(
    words: str, message: str, planned: list[Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["dataset", "build", "ms-render", "--out", str(tmp_path), *words.split()]) == 2
    assert message in capsys.readouterr().err and planned == []
