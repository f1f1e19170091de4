"""The training flows: from pairs, or from motion capture alone, to networks that the package can load."""

from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from pair_windows import pair_arrays
from safetensors.torch import load_file

from humanmm.errors import InputError
from humanmm.flows.bench.render_set import shipped_packs
from humanmm.flows.training import course, lifter
from humanmm.flows.training.lifter import train_keypoints, train_lifter
from humanmm.flows.training.sequences import sequences_of
from humanmm.models.learning.training.lifter import KeypointRecipe, LifterRecipe
from humanmm.models.perception.lifting.network import LifterNetwork
from humanmm.models.weights.eight_bits import unpacked
from humanmm.storage.training.networks import read_network, write_network
from humanmm.storage.training.pair_set import PairSet

RECIPE = LifterRecipe(steps=4, batch=2, warm_up=2)
Train = Callable[[Path], Path]


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    """A checkpoint every two steps, one take, loosened once, one routine."""
    monkeypatch.setattr(course, "CHECKPOINT_STEPS", 2)
    monkeypatch.setattr(course, "VALIDATION_STEPS", 2)
    monkeypatch.setattr(lifter, "MEASURED", 4)
    monkeypatch.setattr("humanmm.models.learning.other_motion.ROUTINES", 1)
    monkeypatch.setattr("humanmm.models.learning.other_motion.LOOSENED_A_TAKE", 1)
    sequences = sequences_of((shipped_packs("places", "train")[1],), "train")[:1]
    monkeypatch.setattr(lifter, "sequences_of", lambda *_: sequences)


def killed_and_resumed(train: Train, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """What a training delivers that was killed after its first checkpoint."""
    write = course.write_checkpoint

    def killed(folder: Path, state: dict[str, object]) -> None:
        write(folder, state)
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(course, "write_checkpoint", killed)
        with pytest.raises(KeyboardInterrupt):
            train(folder)
    return train(folder)


def write_pairs(folder: Path) -> None:
    """A group of each split."""
    for split in ("train", "dev"):
        PairSet(folder, "a").write(f"{split}-00000", pair_arrays(), [{}] * 4)


def same_weights(a: Path, b: Path) -> bool:
    other = load_file(b)
    return all(torch.equal(value, other[name]) for name, value in load_file(a).items())


def test_a_training_delivers_a_network_its_curve_and_its_card_and_resumes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_pairs(tmp_path)
    whole = train_lifter.fn(tmp_path, tmp_path / "a", RECIPE)
    read_network(whole, LifterNetwork.shaped_as)
    assert (tmp_path / "a" / "curve.png").stat().st_size > 5000
    assert "| lifted |" in (tmp_path / "a" / "lifter.md").read_text()
    again = killed_and_resumed(lambda out: train_lifter.fn(tmp_path, out, RECIPE), tmp_path / "b", monkeypatch)
    assert same_weights(whole, again)
    with pytest.raises(InputError, match="another recipe"):
        train_lifter.fn(tmp_path, tmp_path / "b", LifterRecipe(steps=6, batch=2, warm_up=2))


def test_a_lifter_begins_with_a_keypoint_lifter_of_any_depth(tmp_path: Path) -> None:
    write_pairs(tmp_path)
    recipe = LifterRecipe(steps=1, batch=2, warm_up=1, rate=1e-9)
    other = tmp_path / "other.safetensors"
    write_network(other, LifterNetwork(depth=6))
    network = train_lifter.fn(tmp_path, tmp_path / "a", recipe, begin_with=other)
    found, begun = unpacked(load_file(network)), unpacked(load_file(other))
    assert found.keys() == begun.keys()
    assert all(torch.allclose(value, begun[name], atol=1e-3) for name, value in found.items())
    with pytest.raises(InputError, match="holds no network"):
        train_lifter.fn(tmp_path, tmp_path / "b", recipe, begin_with=tmp_path / "nothing.safetensors")


def test_keypoints_are_learnt_from_motion_capture_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recipe = KeypointRecipe(steps=4, batch=2, warm_up=2, depth=2)
    whole = train_keypoints.fn(tmp_path / "a", recipe)
    assert "| lifted from COCO keypoints |" in (tmp_path / "a" / "keypoint_lifter.md").read_text()
    assert same_weights(
        whole, killed_and_resumed(lambda out: train_keypoints.fn(out, recipe), tmp_path / "b", monkeypatch)
    )
    first = "inward.0.weight"
    assert load_file(whole)[first][:, 99:199].abs().max() == 0 < load_file(whole)[first][:, :99].abs().min()


def test_a_keypoint_lifter_goes_on_from_another_with_more_blocks(tmp_path: Path) -> None:
    write_network(tmp_path / "other.safetensors", LifterNetwork(depth=2))
    recipe = KeypointRecipe(steps=1, batch=2, warm_up=1, rate=1e-9, depth=3)
    found = train_keypoints.fn(tmp_path / "a", recipe, begin_with=tmp_path / "other.safetensors")
    network = read_network(found, LifterNetwork.shaped_as)
    assert len(network.blocks) == 3
