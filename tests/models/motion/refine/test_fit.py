"""The terms of the fit over the whole clip: their derivatives, and what they count."""

import numpy as np
import pytest

from humanmm.models.body.body24 import load_body
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.fit.equations import NormalEquations
from humanmm.models.motion.fit.state import NUM_PARAMETERS, Motion, Skeleton
from humanmm.models.motion.refine.fit import FeetOnFloor, PlantedFeet, RootVelocity, Uprightness
from humanmm.models.records.recording import CONTACT_JOINTS

N = 5
TIME = np.array([0.0, 0.03, 0.07, 0.1, 0.14])
FEET = Skeleton(load_body().rest_joints(np.zeros(10)), np.array(CONTACT_JOINTS), np.zeros((4, 3)))


@pytest.fixture
def motion() -> Motion:
    rng = np.random.default_rng(0)
    R_body = rotvec_to_rotmat(0.2 * rng.normal(size=(1, 23, 3)) + 0.01 * rng.normal(size=(N, 23, 3)))
    R_root = rotvec_to_rotmat(0.3 * rng.normal(size=(1, 3)) + 0.01 * rng.normal(size=(N, 3)))
    return Motion(FEET, R_root, 0.005 * rng.normal(size=(N, 3)), R_body)


def test_the_gradient_is_that_of_the_cost(motion: Motion) -> None:
    term = PlantedFeet(FEET, TIME, np.random.default_rng(1).uniform(0.4, 1.0, (N, 4)))
    equations = NormalEquations(N)
    term.add(motion, equations)
    rng = np.random.default_rng(2)
    for _ in range(5):
        direction = rng.normal(size=(N, NUM_PARAMETERS))
        ahead, behind = (term.cost(motion.moved(sign * 1e-6 * direction)) for sign in (1, -1))
        assert np.sum(equations.gradient * direction) == pytest.approx((ahead - behind) / 2e-6, rel=1e-4)


def test_moving_the_whole_body_costs_nothing_and_has_no_curvature(motion: Motion) -> None:
    term = PlantedFeet(FEET, TIME, np.ones((N, 4)))
    shift = np.zeros((N, NUM_PARAMETERS))
    shift[:, 3:6] = [0.3, -0.2, 0.1]
    assert term.cost(motion.moved(shift)) == pytest.approx(term.cost(motion))
    equations = NormalEquations(N)
    term.add(motion, equations)
    H = equations.own.copy()
    curvature = np.einsum("na,nab,nb->", shift, H, shift)
    curvature += 2 * np.einsum("na,nab,nb->", shift[:-1], equations.next_one[:-1], shift[1:])
    assert curvature == pytest.approx(0.0, abs=1e-6 * np.abs(H).max())


def test_feet_that_do_not_stand_do_not_count(motion: Motion) -> None:
    assert PlantedFeet(FEET, TIME, np.full((N, 4), 0.49)).cost(motion) == 0.0
    contacts = np.ones((N, 4))
    contacts[1::2] = 0.0  # never two frames in a row
    assert PlantedFeet(FEET, TIME, contacts).cost(motion) == 0.0


def test_the_gradient_of_feet_on_the_floor_is_that_of_its_cost(motion: Motion) -> None:
    rng = np.random.default_rng(4)
    lowest = motion.with_points(FEET).points[..., 2].mean(axis=0)
    term = FeetOnFloor(FEET, lowest + rng.normal(0, 0.05, 4), rng.uniform(0.0, 1.0, (N, 4)))
    equations = NormalEquations(N)
    term.add(motion, equations)
    direction = rng.normal(size=(N, NUM_PARAMETERS))
    ahead, behind = (term.cost(motion.moved(sign * 1e-6 * direction)) for sign in (1, -1))
    assert np.sum(equations.gradient * direction) == pytest.approx((ahead - behind) / 2e-6, rel=1e-4)


def test_a_foot_on_the_floor_is_drawn_to_its_height_and_one_on_a_table_is_left_alone(motion: Motion) -> None:
    heights = motion.with_points(FEET).points[0, :, 2]

    def pull(above_m: float) -> float:
        standing = np.zeros((N, 4))
        standing[0] = 1.0
        equations = NormalEquations(N)
        FeetOnFloor(FEET, heights - above_m, standing).add(motion, equations)
        return float(equations.gradient[0, 5])  # by the pelvis' height

    assert pull(0.0) == pytest.approx(0.0, abs=1e-9)
    assert pull(0.05) > 2 * pull(0.75) > 0
    assert pull(-0.05) == pytest.approx(-pull(0.05))


def leaning(motion: Motion, degrees: float) -> Motion:
    """The same body about upright, leaning forward."""
    upright = rotvec_to_rotmat(np.array([np.pi / 2, 0.0, 0.0]))  # the body's y axis along the world's z
    R_root = np.tile(rotvec_to_rotmat(np.radians([0.0, degrees, 0.0])) @ upright, (N, 1, 1))
    return Motion(FEET, R_root, motion.pelvis_ref, motion.R_body)


def test_the_gradient_of_uprightness_is_that_of_its_cost(motion: Motion) -> None:
    term, at = Uprightness(np.linspace(0.5, 1.0, N)), leaning(motion, 14.0)
    equations = NormalEquations(N)
    term.add(at, equations)
    direction = np.random.default_rng(3).normal(size=(N, NUM_PARAMETERS))
    ahead, behind = (term.cost(at.moved(sign * 1e-6 * direction)) for sign in (1, -1))
    assert np.sum(equations.gradient * direction) == pytest.approx((ahead - behind) / 2e-6, rel=1e-4)


def test_a_small_lean_is_drawn_upright_and_who_lies_or_stands_on_his_head_is_left_alone(motion: Motion) -> None:
    def pull(degrees: float) -> float:
        equations = NormalEquations(N)
        Uprightness(np.ones(N)).add(leaning(motion, degrees), equations)
        return float(np.abs(equations.gradient).max())

    assert pull(0.0) == pytest.approx(0.0, abs=1e-9)
    assert pull(10.0) > 2 * pull(80.0)  # beyond its scale a Cauchy kernel lets go
    assert pull(170.0) == 0.0


def test_the_root_s_velocity_draws_the_path_and_its_gradient_is_that_of_its_cost(motion: Motion) -> None:
    velocity = np.random.default_rng(4).normal(0, 0.3, (N, 3))
    term = RootVelocity(motion.R_ref_root, velocity, np.full((N, 3), 0.2), TIME, weight=2.0)
    equations = NormalEquations(N)
    term.add(motion, equations)
    direction = np.random.default_rng(5).normal(size=(N, NUM_PARAMETERS))
    direction[:, :3] = 0  # the axes are those in which the network looked
    ahead, behind = (term.cost(motion.moved(sign * 1e-6 * direction)) for sign in (1, -1))
    assert np.sum(equations.gradient * direction) == pytest.approx((ahead - behind) / 2e-6, rel=1e-4)
    span = np.diff(TIME)[:, None]
    steps = np.einsum("nij,nj->ni", motion.R_ref_root[:-1], velocity[:-1]) * span
    path = np.concatenate([motion.pelvis_ref[:1], motion.pelvis_ref[:1] + np.cumsum(steps, axis=0)])
    assert term.cost(Motion(FEET, motion.R_ref_root, path, motion.R_body)) == pytest.approx(0.0, abs=1e-12)
