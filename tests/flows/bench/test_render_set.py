"""`bench ms-render` without --data makes its own set, and finds it again."""

from pathlib import Path

import pytest

from humanmm.cli import main
from humanmm.flows.bench.render_set import SIZES, SetPlan, own_set, shipped_packs

PACKS = shipped_packs()


def test_the_own_set_is_made_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HUMANMM_CACHE", str(tmp_path))
    monkeypatch.setitem(SIZES, "tiny", SIZES["tiny"].__class__(1, (0.2, 0.2), (64, 36), (0, 0)))
    folder = own_set("tiny")
    (video,) = folder.glob("*.mp4")
    made = video.stat().st_mtime_ns
    assert own_set("tiny") == folder
    assert video.stat().st_mtime_ns == made


def test_a_larger_set_begins_with_the_clips_of_a_smaller_one() -> None:
    one, two = (SetPlan(PACKS, "standard", seed=1, count=count).clips() for count in (2, 5))
    assert two[:2] == one


def test_a_size_given_with_a_folder_of_clips_is_a_usage_error(tmp_path: Path) -> None:
    assert main(["bench", "ms-render", "--data", str(tmp_path), "--size", "tiny"]) == 2


def test_a_table_that_cannot_make_its_own_data_asks_for_it() -> None:
    assert main(["bench", "ms-real"]) == 2


def test_dataset_build_refuses_less_than_one_clip(tmp_path: Path) -> None:
    assert main(["dataset", "build", "ms-render", "--out", str(tmp_path / "set"), "--count", "0"]) == 2
