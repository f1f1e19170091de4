"""From a training to its end: checkpoints, errors and the curve."""

import logging
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from humanmm.errors import InputError
from humanmm.flows.training import course
from humanmm.flows.training.course import train_to_end
from humanmm.models.learning.training.loop import Recipe, Training


def line(steps: int, *, patience: int = 8) -> Training[nn.Linear]:
    """A line that learns to be y = 2 x."""

    def loss(network: nn.Linear, rng: np.random.Generator, generator: torch.Generator) -> Tensor:
        x = torch.rand(8, 1, generator=generator) + rng.random()
        error: Tensor = ((network(x) - 2 * x) ** 2).mean()
        return error

    recipe = Recipe(steps=steps, batch=8, rate=0.3, warm_up=1, averaged=0.5, patience=patience)
    return Training(recipe, lambda: nn.Linear(1, 1), loss)


def test_a_killed_training_goes_on_to_the_same_weights(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(course, "CHECKPOINT_STEPS", 20)
    monkeypatch.setattr(course, "VALIDATION_STEPS", 20)

    def errors(network: nn.Linear) -> dict[str, float]:
        return {"slope": float((network.weight - 2).abs().detach())}

    with caplog.at_level(logging.INFO):
        whole = train_to_end(line(80), tmp_path / "a", errors)
    assert errors(whole)["slope"] < 0.3 and "step 80 of 80" in caplog.text
    assert (tmp_path / "a" / "curve.png").stat().st_size > 5000
    write = course.write_checkpoint

    def killed(folder: Path, state: dict[str, object]) -> None:
        write(folder, state)
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(course, "write_checkpoint", killed)
        with pytest.raises(KeyboardInterrupt):
            train_to_end(line(80), tmp_path / "b", errors)
    assert torch.equal(train_to_end(line(80), tmp_path / "b", errors).weight, whole.weight)
    with pytest.raises(InputError, match="another recipe"):
        train_to_end(line(90), tmp_path / "b", errors)


def test_a_training_that_gets_no_better_ends_early_with_its_best_network(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(course, "CHECKPOINT_STEPS", 5)
    monkeypatch.setattr(course, "VALIDATION_STEPS", 5)
    shown: list[torch.Tensor] = []

    def errors(network: nn.Linear) -> dict[str, float]:
        shown.append(network.weight.detach().clone())
        return {"wrong": [3.0, 1.0, 2.0, 1.5, 1.5, 0.0][len(shown) - 1], "best in the end": -len(shown)}

    training = line(100, patience=3)
    best = train_to_end(training, tmp_path, errors)
    assert training.step == 25 and len(shown) == 5
    assert torch.equal(best.weight, shown[1])
    assert torch.equal(train_to_end(line(100, patience=3), tmp_path, errors).weight, shown[1])
    assert len(shown) == 5  # what has ended is not taken up again
