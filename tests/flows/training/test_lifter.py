"""The training flow: from pairs to a network that the package can load."""

from pathlib import Path

import pytest
import torch
from pair_windows import pair_arrays
from safetensors.torch import load_file

from humanmm.errors import InputError
from humanmm.flows.training import course, lifter
from humanmm.flows.training.lifter import train_lifter
from humanmm.models.learning.lifter_training import LifterRecipe
from humanmm.models.perception.lifting.network import LifterNetwork
from humanmm.storage.training.pair_set import PairSet

RECIPE = LifterRecipe(steps=4, batch=2, warm_up=2)


def test_a_training_delivers_a_network_its_curve_and_its_card_and_resumes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(course, "CHECKPOINT_STEPS", 2)
    monkeypatch.setattr(course, "VALIDATION_STEPS", 2)
    monkeypatch.setattr("humanmm.models.learning.other_motion.ROUTINES", 1)
    for split in ("train", "dev"):
        PairSet(tmp_path, "a").write(f"{split}-00000", pair_arrays(), [{}] * 4)
    sequences = lifter.takes_of(lifter.read_pack(lifter.shipped_packs("places", "train")[1]), "train")[:1]
    monkeypatch.setattr(lifter, "takes_of", lambda *_: sequences)
    whole = train_lifter.fn(tmp_path, tmp_path / "a", RECIPE)
    network = LifterNetwork()
    network.load_state_dict({name: value.float() for name, value in load_file(whole).items()})
    assert (tmp_path / "a" / "curve.png").stat().st_size > 5000
    assert "| lifted |" in (tmp_path / "a" / "lifter.md").read_text()

    stop = course.write_checkpoint

    def killed(folder: Path, state: dict[str, object]) -> None:
        stop(folder, state)
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(course, "write_checkpoint", killed)
        with pytest.raises(KeyboardInterrupt):
            train_lifter.fn(tmp_path, tmp_path / "b", RECIPE)
    again = load_file(train_lifter.fn(tmp_path, tmp_path / "b", RECIPE))
    assert all(torch.equal(value, again[name]) for name, value in load_file(whole).items())
    with pytest.raises(InputError, match="another recipe"):
        train_lifter.fn(tmp_path, tmp_path / "b", LifterRecipe(steps=6, batch=2, warm_up=2))
