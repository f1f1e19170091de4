"""Other motion before the cameras of windows: a body of its own, seen as the window's person was."""

import numpy as np
import torch
from pair_windows import pair_arrays, walk

from humanmm.models.learning.other_motion import OtherMotion, with_routines
from humanmm.models.learning.windows import PairErrors, windows_of


def test_without_errors_the_input_is_the_truth_and_bones_keep_their_lengths() -> None:
    windows, errors = windows_of(pair_arrays())
    nothing = PairErrors(*(torch.zeros_like(part) for part in (errors.points, errors.landmarks, errors.systematic)))
    other = OtherMotion([walk()], pair_arrays(), windows, nothing, routines=0.3)
    drawn = other.draw(6, np.random.default_rng(0))
    assert torch.equal(drawn.landmarks, drawn.truth) and not drawn.swapped.any()
    thigh = (drawn.truth[:, :, 23] - drawn.truth[:, :, 25]).norm(dim=-1)
    assert thigh.std() < 0.02  # a take's frames are interpolated
    left = drawn.truth[:, :, 23] - drawn.truth[:, :, 24]
    left = left / left.norm(dim=-1, keepdim=True)
    assert ((drawn.pose[:, :, 0, :, 0] * left).sum(dim=-1) > 0.9).all()


def test_the_seed_decides_what_is_drawn() -> None:
    windows, errors = windows_of(pair_arrays())
    other = OtherMotion([walk()], pair_arrays(), windows, errors, routines=0.3)
    a, b, c = (other.draw(3, np.random.default_rng(seed)).truth for seed in (1, 1, 2))
    assert torch.equal(a, b) and not torch.equal(a, c)


def test_routines_have_their_fraction() -> None:
    is_routine = np.array([False, True, False, True])
    probability = with_routines(np.array([6.0, 1.0, 2.0, 1.0]), is_routine, 0.4)
    np.testing.assert_allclose(probability, [0.45, 0.2, 0.15, 0.2])
    np.testing.assert_allclose(with_routines(np.ones(2), np.zeros(2, bool), 0.4), 0.5)  # there are none
