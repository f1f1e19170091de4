"""The keypoint refiner's flow: from looks to a network that the package can load."""

from pathlib import Path

import pytest
from pair_windows import pair_arrays
from refiner_looks import look_arrays

from humanmm.errors import InputError
from humanmm.flows.training import course
from humanmm.flows.training.keypoint_refiner import train_keypoint_refiner
from humanmm.models.learning.training.keypoint_refiner import RefinerRecipe
from humanmm.models.perception.keypoints.network import KeypointRefiner
from humanmm.storage.training.networks import read_network
from humanmm.storage.training.pair_set import PairSet


def test_a_training_delivers_a_network_its_curve_and_its_card(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(course, "CHECKPOINT_STEPS", 2)
    monkeypatch.setattr(course, "VALIDATION_STEPS", 2)
    for split in ("train", "dev"):
        PairSet(tmp_path, "a").write(f"{split}-00000", look_arrays(), [{}] * 4)
    file = train_keypoint_refiner.fn(tmp_path, tmp_path / "out", RefinerRecipe(steps=4, batch=8, warm_up=2))
    read_network(file, KeypointRefiner.shaped_as)
    assert (tmp_path / "out" / "curve.png").stat().st_size > 5000
    card = file.with_suffix(".md").read_text()
    assert "32 looks" in card and "| refined |" in card


def test_pairs_are_no_looks(tmp_path: Path) -> None:
    for split in ("train", "dev"):
        PairSet(tmp_path, "a").write(f"{split}-00000", pair_arrays(), [{}] * 4)
    with pytest.raises(InputError, match=r"holds no looks \(windows, .*humanmm train looks makes them"):
        train_keypoint_refiner.fn(tmp_path, tmp_path / "out")


def test_without_looks_it_says_how_to_make_them(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="humanmm train looks"):
        train_keypoint_refiner.fn(tmp_path, tmp_path / "out")
