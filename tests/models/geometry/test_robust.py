"""Robust kernels: a weight is what the loss's slope says, and standard deviations of normal errors come out right."""

from collections.abc import Callable

import numpy as np
import pytest

from humanmm.models.geometry.robust import (
    STD_PER_MEDIAN,
    cauchy_loss,
    cauchy_weight,
    huber_loss,
    huber_weight,
    std_of_lengths,
)

SIZES = np.linspace(0.01, 8.0, 400)


@pytest.mark.parametrize(
    ("loss", "weight"),
    [
        (lambda r: cauchy_loss(r**2), lambda r: cauchy_weight(r**2)),
        (lambda r: huber_loss(r, 1.5), lambda r: huber_weight(r, 1.5)),
    ],
    ids=["Cauchy", "Huber"],
)
def test_the_weight_is_the_slope_of_the_loss_over_that_of_the_square(
    loss: Callable[[np.ndarray], np.ndarray], weight: Callable[[np.ndarray], np.ndarray]
) -> None:
    slope = (loss(SIZES + 1e-6) - loss(SIZES - 1e-6)) / 2e-6
    np.testing.assert_allclose(weight(SIZES), slope / (2 * SIZES), rtol=1e-5)


def test_standard_deviations_of_normal_errors_are_found() -> None:
    errors = 3.0 * np.random.default_rng(0).normal(size=(200_000, 2))
    assert abs(std_of_lengths(np.linalg.norm(errors, axis=1)) - 3.0) < 0.03
    assert abs(STD_PER_MEDIAN * np.median(np.abs(errors)) - 3.0) < 0.03


def test_no_errors_have_no_standard_deviation() -> None:
    assert np.isnan(std_of_lengths(np.zeros(0)))
