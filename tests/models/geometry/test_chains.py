"""The chain solver against all sequences of states."""

from itertools import product

import numpy as np
import pytest

from humanmm.models.geometry.chains import least_energy_states, two_state_chain


@pytest.mark.parametrize(("n", "k", "seed"), [(1, 3, 0), (2, 2, 1), (6, 3, 2), (7, 2, 3), (4, 5, 4)])
def test_no_sequence_of_states_has_less_energy(n: int, k: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    unary, pairwise = rng.normal(size=(n, k)), rng.normal(size=(n - 1, k, k))

    def energy(states: tuple[int, ...]) -> float:
        steps = sum(pairwise[i, states[i], states[i + 1]] for i in range(n - 1))
        return float(sum(unary[i, s] for i, s in enumerate(states)) + steps)

    best = min(product(range(k), repeat=n), key=energy)
    np.testing.assert_array_equal(least_energy_states(unary, pairwise), best)


def test_two_states_pay_for_agreeing_or_differing() -> None:
    rng = np.random.default_rng(2)
    unary, pairs = rng.normal(size=(7, 2)), rng.normal(size=(6, 2))

    def energy(states: tuple[int, ...]) -> float:
        differ = np.diff(states) != 0
        return float(unary[np.arange(7), states].sum() + pairs[np.arange(6), differ.astype(int)].sum())

    best = min(product(range(2), repeat=7), key=energy)
    np.testing.assert_array_equal(two_state_chain(unary, pairs), np.array(best, bool))


def test_a_chain_without_nodes_has_no_states_and_pairs_must_fit() -> None:
    assert least_energy_states(np.zeros((0, 2)), np.zeros((0, 2, 2))).shape == (0,)
    with pytest.raises(ValueError, match="3 nodes with 2 states has 2 pairs"):
        least_energy_states(np.zeros((3, 2)), np.zeros((3, 2, 2)))
