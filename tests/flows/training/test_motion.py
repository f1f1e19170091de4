"""ms-HMR, predictor and refiner from pairs to files that the package can load."""

from pathlib import Path

import pytest
from pair_windows import pair_arrays

from humanmm.flows.training import motion
from humanmm.flows.training.motion import Material, train_ms_hmr, train_refiner, train_trajectory
from humanmm.models.learning.training.motion import MotionRecipe
from humanmm.models.motion.networks.ms_hmr import MsHmr
from humanmm.models.motion.networks.trajectory import TrajectoryRefiner
from humanmm.storage.training.networks import read_network
from humanmm.storage.training.pair_set import PairSet

RECIPE = MotionRecipe(steps=2, batch=2, warm_up=1)


def test_each_training_delivers_its_network_its_curve_and_its_card(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(motion, "DEV_CLIPS", 32)
    monkeypatch.setattr(motion, "ROUTINES", 1)
    monkeypatch.setattr(motion, "sequences_of", lambda *_: [])
    for split in ("train", "dev"):
        PairSet(tmp_path, "a").write(f"{split}-00000", pair_arrays(), [{}] * 4)
    material = Material(tmp_path, threads=1)
    ms_hmr = train_ms_hmr.fn(material, tmp_path / "m", RECIPE)
    predictor = train_trajectory.fn(material, tmp_path / "t", ms_hmr, RECIPE)
    refiner = train_refiner.fn(material, tmp_path / "r", ms_hmr, predictor, RECIPE)
    assert (tmp_path / "fits" / "train-00000.zarr").is_dir()
    read_network(ms_hmr, lambda _: MsHmr()), read_network(refiner, lambda _: TrajectoryRefiner())
    assert "| ms-HMR |" in (tmp_path / "m" / "ms_hmr.md").read_text()
    card = (tmp_path / "r" / "trajectory_refiner.md").read_text()
    assert "| as the fits have it | none given |" in card and "| refiner |" in card
    assert all((tmp_path / name / "curve.png").is_file() for name in "mtr")
