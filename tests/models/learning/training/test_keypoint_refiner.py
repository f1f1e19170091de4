"""The keypoint refiner's training: it learns what stands in the layers, and its loss wants honest errors."""

import numpy as np
import pytest
import torch
from refiner_looks import look_arrays

from humanmm.models.learning.training.keypoint_refiner import (
    Looks,
    RefinerRecipe,
    loss,
    refiner_score,
    refiner_training,
)
from humanmm.models.perception.keypoints.network import SIGMA_PX


def test_a_few_steps_find_shifts_that_the_windows_show() -> None:
    looks = Looks.of(look_arrays())
    training = refiner_training(RefinerRecipe(steps=60, batch=16, warm_up=5, averaged=0.8, dropout=0.0), looks)
    training.run(60, lambda _, __: None)
    network = training.with_weights(training.averaged)
    before, after = refiner_score(None, looks), refiner_score(network, looks)
    assert after.limbs[1] < 0.8 * before.limbs[1]
    assert before.limbs[0] > 1.0 and before.feet[0] > 1.0 and before.hands[0] > 1.0


def test_an_error_foretold_is_best_where_it_is_the_error() -> None:
    nothing = torch.zeros(1, 22, 2)
    wanted = torch.zeros(1, 22, 2)
    wanted[..., 0] = 8.0
    known = torch.ones(1, 22, dtype=torch.bool)
    values = {px: float(loss(nothing, torch.full((1, 22), px), wanted, known)) for px in (4.0, 8.0, 16.0)}
    assert min(values, key=lambda px: values[px]) == 8.0
    exact = loss(wanted, torch.full((1, 22), SIGMA_PX), wanted, known)
    assert float(exact) < values[4.0]


def test_landmarks_that_are_not_known_teach_nothing() -> None:
    shift = torch.zeros(1, 22, 2, requires_grad=True)
    known = torch.zeros(1, 22, dtype=torch.bool)
    known[0, 3] = True
    loss(shift, torch.ones(1, 22), torch.ones(1, 22, 2), known).backward()
    assert shift.grad is not None
    assert set(np.flatnonzero(shift.grad[0].abs().sum(dim=-1))) == {3}


def test_units_are_how_large_a_channel_is() -> None:
    windows, coarse = Looks.of(look_arrays()).units()
    assert windows.shape == (74,) and coarse.shape == (96,)
    assert float(windows.mean()) == pytest.approx(1.0, abs=0.05)
