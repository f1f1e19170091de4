"""Verticals of several shots, some of them wrong."""

import numpy as np

from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.rotations.rotation_mixtures import Upright
from humanmm.models.motion.rotations.verticals import Verticals

UP = np.array([0.0, -1.0, 0.0])


def tilted(deg: float) -> np.ndarray:
    return rotvec_to_rotmat(np.radians([deg, 0.0, 0.0]))


def test_those_that_agree_are_likelier_than_chance_and_one_that_does_not_costs_no_more_than_being_wrong() -> None:
    verticals = Verticals.of([Upright(UP, 1.0)] * 4)
    off = [0.0, 3.0, 20.0, 90.0, 180.0]
    R = np.stack([np.stack([np.eye(3), np.eye(3), np.eye(3), tilted(deg)]) for deg in off])
    density, kappa = verticals.log_density(R)
    assert (np.diff(density) < 0).all() and density[0] > 0
    assert density[0] - density[-1] < 20, "a normal distribution would take off 16,200"
    assert (kappa[2:, 3] < kappa[2:, 0]).all() and (kappa[:2] == kappa[0, 0]).all()


def test_the_wrong_one_is_found_wherever_it_stands() -> None:
    verticals = Verticals.of([Upright(UP, 1.0)] * 4)
    for wrong in range(4):
        R = np.tile(np.eye(3), (1, 4, 1, 1))
        R[0, wrong] = tilted(70.0)
        _, kappa = verticals.log_density(R)
        assert int(kappa[0].argmin()) == wrong and np.unique(kappa[0]).size == 2


def test_shots_without_a_vertical_say_nothing() -> None:
    verticals = Verticals.of([Upright(UP, 1.0), None, None])
    R = np.stack([np.eye(3), tilted(90.0), tilted(30.0)])[None]
    density, kappa = verticals.log_density(R)
    assert density[0] == 0.0 and kappa[0, 1] == kappa[0, 2] == 0.0
