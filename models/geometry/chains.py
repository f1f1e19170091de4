"""States of least energy along a chain, found exactly by dynamic programming.

Viterbi, "Error bounds for convolutional codes and an asymptotically optimum decoding algorithm" (IEEE Transactions on
Information Theory 13, 1967); Forney, "The Viterbi algorithm" (Proceedings of the IEEE 61, 1973).
"""

import numpy as np
from jaxtyping import Bool, Float, Int

Array = np.ndarray


def least_energy_states(unary: Float[Array, "n k"], pairwise: Float[Array, "n-1 k k"]) -> Int[Array, " n"]:
    """The states s that minimise Σ unary[i, s_i] + Σ pairwise[i, s_i, s_i+1] over a chain of n nodes with k states.

    Of equally good states the one with the lower number is taken. Forney 1973, section II: Γ(s) is the energy of the
    best path that ends in state s, the survivor the state from which that path came.
    """
    n, k = unary.shape
    if pairwise.shape != (max(n - 1, 0), k, k):
        raise ValueError(f"a chain of {n} nodes with {k} states has {max(n - 1, 0)} pairs, got {pairwise.shape}")
    states = np.zeros(n, np.int64)
    if not n:
        return states
    energy, survivor = unary[0], np.zeros((n, k), np.int64)
    for i in range(1, n):
        paths = energy[:, None] + pairwise[i - 1]
        survivor[i] = paths.argmin(axis=0)
        energy = paths.min(axis=0) + unary[i]
    states[-1] = energy.argmin()
    for i in range(n - 1, 0, -1):
        states[i - 1] = survivor[i, states[i]]
    return states


def two_state_chain(unary: Float[Array, "n 2"], agree_differ: Float[Array, "n-1 2"]) -> Bool[Array, " n"]:
    """The chain of least energy whose pairs care only whether their nodes agree: energies [i, 0] if nodes i and i + 1
    are in the same state, [i, 1] if not."""
    return np.asarray(least_energy_states(unary, agree_differ[:, [[0, 1], [1, 0]]]) == 1)
