"""Mixtures of rotation hypotheses: densities integrate to one, wrong rotations are about the vertical, voices count."""

import numpy as np
import roma
import torch

from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.world.rotation_mixtures import (
    LOG_VOLUME,
    RotationEdge,
    RotationHypothesis,
    Upright,
    Volume,
    mixtures,
)

UP = Upright(np.array([0.0, -1.0, 0.0]), 10.0)


def edge(sigma_deg: float = 25.0, num_inliers: int = 0, a: int = 0, b: int = 1) -> RotationEdge:
    return RotationEdge(a, b, (RotationHypothesis(np.eye(3), sigma_deg, 0.8),), "plane", num_inliers)


def test_the_density_over_all_rotations_is_one() -> None:
    """Integrated over the angle, whose share of all rotations is (1 - cos) / pi; and for "none", over random ones."""
    (mixture,) = mixtures([edge()], [None, None])
    angle = np.linspace(0, np.pi, 4000)
    density = np.exp(mixture.log_density(mixture.components(rotvec_to_rotmat(angle[:, None] * [1.0, 0.0, 0.0]))))
    assert abs(np.trapezoid(density * (1 - np.cos(angle)) / np.pi, angle) - 1) < 0.03
    torch.manual_seed(0)
    anywhere = roma.random_rotmat(20_000, dtype=torch.float64).numpy()
    (mixture,) = mixtures([edge()], [UP, UP])
    assert abs(np.exp(mixture.components(anywhere)[:, -1]).mean() - 0.2) < 0.01


def test_where_no_hypothesis_is_true_rotations_about_the_vertical_are_likelier() -> None:
    (mixture,) = mixtures([edge(2.0)], [UP, UP])
    about_up, tilted = (rotvec_to_rotmat(np.array(v)) for v in ([0.0, 2.0, 0.0], [2.0, 0.0, 0.0]))
    assert mixture.components(about_up)[-1] > mixture.components(tilted)[-1] + 3


def test_all_backgrounds_of_a_shot_are_one_witness_and_a_half() -> None:
    walls = [edge(2.0, 60, a, b) for a, b in ((0, 1), (0, 2), (1, 2), (0, 3), (1, 3), (2, 3))]
    found = mixtures([*walls, edge()], [None] * 4)
    assert all(abs(one.weight - 0.5) < 1e-9 for one in found[:-1]) and found[-1].weight == 1.0
    assert mixtures(walls[:1], [None] * 2)[0].weight == 1.0


def test_the_volume_of_a_chain_is_that_of_its_steps() -> None:
    """Two edges of 0.1 rad an axis: each step's normal volume as a fraction of all rotations."""
    volume = Volume(np.zeros((1, 3, 3)), np.zeros((1, 3, 3)))
    for a, b in ((0, 1), (1, 2)):
        volume.connect(a, b, np.array([100.0]), np.array([0.0]))
    step = 1.5 * np.log(2 * np.pi * 0.01) - LOG_VOLUME
    np.testing.assert_allclose(volume.log(), [2 * step])
