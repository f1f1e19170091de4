"""Rotations: round trips and known answers."""

import numpy as np
import pytest
import roma
import torch
from scipy.spatial.transform import Rotation, Slerp

from humanmm.models.geometry.rotations import (
    interpolate_rotations,
    nearest_rotation,
    rotation_angle,
    rotmat_to_rotvec,
    rotmat_to_unitquat_wxyz,
    rotvec_to_rotmat,
    skew,
    swing,
)


def test_exponential_map_agrees_with_scipy_from_zero_to_a_full_rotation(rng: np.random.Generator) -> None:
    vectors = rng.normal(size=(500, 3)) * np.geomspace(1e-12, 3, 500)[:, None]
    np.testing.assert_allclose(rotvec_to_rotmat(vectors), Rotation.from_rotvec(vectors).as_matrix(), atol=1e-12)


def test_logarithm_inverts_the_exponential_map_up_to_half_a_turn(rng: np.random.Generator) -> None:
    axes = rng.normal(size=(400, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    vectors = axes * np.concatenate([np.geomspace(1e-10, 3.14, 399), [np.pi - 1e-9]])[:, None]
    np.testing.assert_allclose(rotmat_to_rotvec(rotvec_to_rotmat(vectors)), vectors, atol=1e-7)


def test_quaternions_have_unit_length_and_match_scipy() -> None:
    R = Rotation.random(300, random_state=1).as_matrix()
    q = rotmat_to_unitquat_wxyz(R)
    reference = Rotation.from_matrix(R).as_quat(scalar_first=True)
    np.testing.assert_allclose(np.abs(np.sum(q * reference, axis=1)), 1, atol=1e-12)


def test_skew_is_the_cross_product(rng: np.random.Generator) -> None:
    a, b = rng.normal(size=(2, 20, 3))
    np.testing.assert_allclose((skew(a) @ b[..., None])[..., 0], np.cross(a, b), atol=1e-14)


def test_projection_onto_rotations_is_proper_even_for_a_mirror() -> None:
    assert np.linalg.det(nearest_rotation(np.diag([1.0, 1.0, -0.5]))) > 0.999


def test_swing_takes_one_direction_to_the_other_and_survives_opposite_ones(rng: np.random.Generator) -> None:
    a, b = rng.normal(size=(2, 50, 3))
    b[0] = -a[0]
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    b /= np.linalg.norm(b, axis=1, keepdims=True)
    np.testing.assert_allclose((swing(a, b) @ a[..., None])[..., 0], b, atol=1e-9)


@pytest.mark.parametrize("angle", [1e-7, 1e-3, 1.0, 3.0, np.pi - 1e-7])
def test_angles_are_exact_from_tiny_to_half_a_turn(angle: float) -> None:
    R = rotvec_to_rotmat(angle * np.array([0.6, 0.0, 0.8]))
    np.testing.assert_allclose(rotation_angle(R), angle, rtol=1e-6)


def test_interpolation_is_scipys_and_holds_the_ends() -> None:
    known_at, R = np.array([0.0, 1.0, 2.5]), Rotation.random(3, random_state=3)
    at = np.array([0.0, 0.3, 1.0, 1.7, 2.5])
    np.testing.assert_allclose(
        interpolate_rotations(at, known_at, R.as_matrix()), Slerp(known_at, R)(at).as_matrix(), atol=1e-9
    )
    np.testing.assert_allclose(
        interpolate_rotations(np.array([-1.0, 9.0]), known_at, R.as_matrix()), R.as_matrix()[[0, 2]]
    )


def test_names_shared_with_roma_mean_what_they_mean_there(rng: np.random.Generator) -> None:
    vectors = rng.normal(size=(50, 3))
    R = rotvec_to_rotmat(vectors)
    np.testing.assert_allclose(roma.rotvec_to_rotmat(torch.tensor(vectors)).numpy(), R, atol=1e-12)
    np.testing.assert_allclose(roma.rotmat_to_rotvec(torch.tensor(R)).numpy(), rotmat_to_rotvec(R), atol=1e-9)
    np.testing.assert_allclose(
        roma.special_procrustes(torch.tensor(R + 0.1)).numpy(), nearest_rotation(R + 0.1), atol=1e-9
    )
