"""Mixtures of rotation hypotheses: densities integrate to one, wrong rotations are about the vertical, voices count."""

import numpy as np
import roma
import torch

from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.rotations.rotation_mixtures import (
    COMPARE_ALL,
    LOG_VOLUME,
    NEIGHBOURS,
    Mixtures,
    RotationEdge,
    RotationHypothesis,
    Upright,
    compared,
    laplacian,
    log_graph_volume,
)

UP = Upright(np.array([0.0, -1.0, 0.0]), 10.0)


def edge(sigma_deg: float = 25.0, num_inliers: int = 0, a: int = 0, b: int = 1) -> RotationEdge:
    return RotationEdge(a, b, (RotationHypothesis(np.eye(3), sigma_deg, 0.8),), "plane", num_inliers)


def test_the_density_over_all_rotations_is_one() -> None:
    """Integrated over the angle, whose share of all rotations is (1 - cos) / pi; and for "none", over random ones."""
    mixture = Mixtures.of([edge()], [None, None])
    angle = np.linspace(0, np.pi, 4000)
    about_x = rotvec_to_rotmat(angle[:, None] * [1.0, 0.0, 0.0])
    density = np.exp(mixture.log_density(mixture.shares(about_x[:, None])))
    assert abs(np.trapezoid(density * (1 - np.cos(angle)) / np.pi, angle) - 1) < 0.03
    torch.manual_seed(0)
    anywhere = roma.random_rotmat(20_000, dtype=torch.float64).numpy()
    mixture = Mixtures.of([edge()], [UP, UP])
    assert abs(np.exp(mixture.shares(anywhere[:, None]).none).mean() - 0.2) < 0.01


def test_where_no_hypothesis_is_true_rotations_about_the_vertical_are_likelier() -> None:
    mixture = Mixtures.of([edge(2.0)], [UP, UP])
    about_up, tilted = mixture.shares(rotvec_to_rotmat(np.array([[[0.0, 2.0, 0.0]], [[2.0, 0.0, 0.0]]]))).none
    assert about_up > tilted + 3


def test_several_edges_say_what_each_says_alone() -> None:
    both = RotationEdge(
        0,
        2,
        (
            RotationHypothesis(np.eye(3), 5.0, 0.5),
            RotationHypothesis(rotvec_to_rotmat(np.array([0.0, 1.0, 0.0])), 9.0, 0.3),
        ),
    )
    edges = [edge(), both, edge(8.0, 40, 1, 2)]
    R = rotvec_to_rotmat(np.array([[0.1, 0.2, 0.0], [0.0, 0.4, 0.3], [0.0, 0.1, 0.9]]))
    together = Mixtures.of(edges, [UP, None, UP])
    shares = together.shares(R)
    every, level = together.precision(shares)
    for k, one in enumerate(edges):
        alone = together.some(np.array([k]))
        assert alone.edges == (one,)
        own = alone.shares(R[k : k + 1])
        np.testing.assert_allclose(own.density, shares.density[k : k + 1])
        np.testing.assert_allclose(np.stack(alone.precision(own))[:, 0], [every[k], level[k]])
        assert alone.believed(own)[0] == together.believed(shares)[k]


def test_all_backgrounds_of_a_shot_are_one_witness_and_a_half() -> None:
    walls = [edge(2.0, 60, a, b) for a, b in ((0, 1), (0, 2), (1, 2), (0, 3), (1, 3), (2, 3))]
    weight = Mixtures.of([*walls, edge()], [None] * 4).weight
    np.testing.assert_allclose(weight, [*[0.5] * 6, 1.0])
    assert Mixtures.of(walls[:1], [None] * 2).weight == 1.0


def test_the_volume_of_a_chain_is_that_of_its_steps() -> None:
    """Two edges of 0.1 rad an axis: each step's normal volume as a fraction of all rotations."""
    every = laplacian(np.array([[0, 1], [1, 2]]), np.array([[100.0, 100.0]]), 3)
    step = 1.5 * np.log(2 * np.pi * 0.01) - LOG_VOLUME
    np.testing.assert_allclose(log_graph_volume(every, np.zeros_like(every)), [2 * step])


def test_in_long_videos_each_shot_is_compared_with_the_next_ones() -> None:
    assert len(compared(range(COMPARE_ALL))) == COMPARE_ALL * (COMPARE_ALL - 1) // 2
    many = compared([3 * shot for shot in range(30)])
    assert len(many) == 29 + 28 + 27 and max(b - a for a, b in many) == 3 * NEIGHBOURS
